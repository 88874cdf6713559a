/* Derives the parameters, pose, grid and options of a phantom from the command line. */
#include <math.h>
#include <string.h>

#include "inputs/grid_cut.h"
#include "phantom_command.h"
#include "report/files.h"
#include "report/report_audit.h"
#include "report/terminal.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/shape_box.h"
#include "sdm/memory.h"

/* True when one of the arguments "name=value" has this name. */
static bool has_word(const cli_list *words, const char *name)
{
    const size_t length = strlen(name);
    for (size_t i = 0; i < words->n; i++)
        if (!strncmp(words->items[i], name, length) && words->items[i][length] == '=') return true;
    return false;
}

/* --random-params: draws the parameters without a -p value. */
static sdm_status draw_params(cli_phantom *p, sdm_error *err)
{
    cli_shape *shape = &p->shape;
    double *drawn = NULL;
    if (!p->args->phantom.random_params) return SDM_OK;
    const sdm_status s = SDM_ALLOC(&drawn, shape->n_params, "parameters", err);
    if (s) return s;
    sdm_phantom_random_params(shape->instance, p->opts.seed, drawn);
    for (size_t i = 0; i < shape->n_params; i++)
        if (!has_word(&p->args->params, shape->params[i].name)) shape->values[i] = drawn[i];
    sdm_free(drawn);
    return SDM_OK;
}

/* Sets the pose: that of --rotation and --translation, followed by a random rotation and
 * translation: rotation = R_random R_given, translation = t_given + t_random. */
static sdm_status read_pose(cli_phantom *p, sdm_error *err)
{
    const cli_phantom_args *a = &p->args->phantom;
    const cli_pose_args *pose = &p->args->pose;
    for (int i = 0; i < 3; i++) {
        p->pose.rotation[i] = isnan(pose->rotation[i]) ? 0 : pose->rotation[i];
        p->pose.translation[i] = isnan(pose->translation[i]) ? 0 : pose->translation[i];
    }
    if (isnan(a->random_pose[0])) return SDM_OK;
    if (a->random_pose[0] > 180)
        return sdm_fail(err, SDM_E_ARG, "--random-pose: a rotation of %g degrees, need at most 180",
                        a->random_pose[0]);
    const double degree = acos(-1) / 180;
    const sdm_pose drawn =
        sdm_phantom_random_pose(a->random_pose[0] * degree, a->random_pose[1], p->opts.seed);
    const sdm_pose turn = {.rotation = {drawn.rotation[0], drawn.rotation[1], drawn.rotation[2]}};
    const sdm_pose given = {
        .rotation = {p->pose.rotation[0], p->pose.rotation[1], p->pose.rotation[2]}};
    const sdm_pose both = sdm_pose_compose(&turn, &given);
    for (int i = 0; i < 3; i++) {
        p->pose.rotation[i] = both.rotation[i];
        p->pose.translation[i] += drawn.translation[i];
    }
    return SDM_OK;
}

/* *t = the given mean and standard deviation, unless the option is missing. */
static void set_tissue(const double given[2], sdm_tissue *t)
{
    if (!isnan(given[0])) *t = (sdm_tissue){given[0], given[1]};
}

static void read_options(cli_phantom *p)
{
    const cli_phantom_args *a = &p->args->phantom;
    p->opts = sdm_phantom_defaults();
    set_tissue(a->inside, &p->opts.inside);
    set_tissue(a->outside, &p->opts.outside);
    set_tissue(a->air, &p->opts.air);
    const double contrast = fabs(p->opts.inside.mean - p->opts.outside.mean);
    if (p->args->outputs.n && !(contrast > 0))
        cli_warn("--inside and --outside have the same mean: the image does not show the shape");
    if (!isnan(a->air_cells[0])) {
        p->opts.air_share = a->air_cells[0];
        p->opts.air_mm = a->air_cells[1];
        p->opts.air_clear_mm = a->air_cells[2];
    }
    for (int i = 0; i < 3; i++)
        if (!isnan(a->blur[i])) p->opts.blur[i] = a->blur[i];
    if (!isnan(a->texture)) p->opts.texture_mm = a->texture;
    if (!isnan(a->noise)) p->opts.noise = a->noise;
    if (a->supersample) p->opts.supersampling = (int)a->supersample;
    p->opts.noise_is_blurred = !a->white_noise;
    p->opts.n_threads = (int)p->args->threads;
    p->opts.cancelled = cli_interrupted;
    if (p->args->seed >= 0) p->opts.seed = (uint64_t)p->args->seed;
}

/* ---- the grid ---- */

/* Transforms the vertices from the shape's frame through the world into the frame of the image;
 * min .. max is the bounding box of the mesh there. */
static void mesh_to_image_frame(const cli_phantom *p, const sdm_pose *frame, sdm_mesh *mesh,
                                double min[3], double max[3])
{
    const sdm_pose back = sdm_pose_inverse(frame), all = sdm_pose_compose(&back, &p->pose);
    sdm_box box = SDM_BOX_EMPTY;
    for (size_t v = 0; v < mesh->n_vert; v++)
        sdm_pose_apply(&all, mesh->vert + 3 * v, mesh->vert + 3 * v);
    sdm_box_add_mesh(&box, mesh);
    for (int i = 0; i < 3; i++) min[i] = box.min[i], max[i] = box.max[i];
}

/* --crop: cuts the grid (in the frame of the image) so that one end lies inside the box min .. max
 * of the shape. A fraction f > 0 ends the grid at max - f (max - min), f < 0 begins it at min - f
 * (max - min). With --size the grid moves as a whole. */
static sdm_status grid_crop(const cli_phantom *p, const double min[3], const double max[3],
                            sdm_grid *g, sdm_error *err)
{
    for (int i = 0; i < 3; i++) {
        const double share = p->args->phantom.crop[i], extent = max[i] - min[i], h = g->spacing[i];
        if (isnan(share) || share == 0) continue;
        const double last = g->origin[i] + (double)(g->n[i] - 1) * h;
        // length of the grid beyond the new end, mm
        const double far =
            share > 0 ? last - (max[i] - share * extent) : min[i] - share * extent - g->origin[i];
        const int64_t drop = (int64_t)ceil(fmax(far / h, 0));
        if (p->args->size[i] > 0) {
            g->origin[i] += share > 0 ? -(double)drop * h : (double)drop * h;
            continue;
        }
        if (drop >= g->n[i])
            return sdm_fail(err, SDM_E_ARG, "--crop %g along %c leaves no voxel of the grid", share,
                            "xyz"[i]);
        g->n[i] -= drop;
        if (share < 0) g->origin[i] += (double)drop * h;
    }
    return SDM_OK;
}

/* Gives the image the grid of the file that --like names, and warns if the shape, moved to its pose
 * here, leaves this grid. */
static sdm_status grid_like(cli_phantom *p, sdm_mesh *mesh, sdm_error *err)
{
    const sdm_status s = cli_like_grid(p->args, &p->grid, err);
    if (s) return s;
    for (size_t v = 0; v < mesh->n_vert; v++)
        sdm_pose_apply(&p->pose, mesh->vert + 3 * v, mesh->vert + 3 * v);
    p->cut = sdm_grid_mesh_beyond(&p->grid, mesh, NULL) > 0;
    cli_warn_cut_shape(&p->grid, mesh, "another pose (--translation, --rotation) or grid holds it");
    return SDM_OK;
}

/* Makes the grid: fits it to the shape in the frame of the image, crops it, then moves it to the
 * world. */
static sdm_status grid_make(cli_phantom *p, sdm_mesh *mesh, sdm_error *err)
{
    const cli_args *args = p->args;
    const double *turn = args->phantom.frame;
    const bool placed = isfinite(args->origin[0]);
    const sdm_pose frame = {.rotation = {isnan(turn[0]) ? 0 : turn[0], isnan(turn[1]) ? 0 : turn[1],
                                         isnan(turn[2]) ? 0 : turn[2]}};
    double min[3], max[3];
    if (args->like) return grid_like(p, mesh, err);
    mesh_to_image_frame(p, &frame, mesh, min, max);
    if (placed && !isnan(args->phantom.crop[0]))
        return sdm_fail(
            err, SDM_E_ARG,
            "--crop and --origin exclude each other: both determine the position of the grid");
    sdm_status s = cli_grid_for_box(args, min, max, &p->grid, err);
    if (s) return s;
    if (placed) // --origin is in the world, the grid still in the frame of the image
        sdm_pose_apply_inverse(&frame, p->grid.origin, p->grid.origin);
    s = grid_crop(p, min, max, &p->grid, err);
    if (!s && isnan(args->phantom.crop[0]))
        cli_warn_cut_shape(&p->grid, mesh,
                           "a larger field of view (--size, --spacing, --origin) holds it");
    for (int i = 0; i < 3; i++) {
        const double end = p->grid.origin[i] + (double)(p->grid.n[i] - 1) * p->grid.spacing[i];
        p->cut |= min[i] < p->grid.origin[i] || max[i] > end;
    }
    sdm_pose_apply(&frame, p->grid.origin, p->grid.origin);
    sdm_pose_matrix(&frame, p->grid.dir);
    return s;
}

/* Refuses options of the image where none is written: labels, truth and surface do not have them.
 */
static sdm_status check_image_options(const cli_args *args, sdm_error *err)
{
    static const char *const names[] = {"inside",  "outside", "air",         "air-cells", "blur",
                                        "texture", "noise",   "white-noise", "type"};
    for (size_t i = 0; i < args->n_given && !args->outputs.n; i++)
        for (size_t k = 0; k < sizeof names / sizeof *names; k++)
            if (!strcmp(args->given[i].option->name, names[k]))
                return sdm_fail(err, SDM_E_ARG,
                                "phantom: --%s does nothing without an image, -o FILE", names[k]);
    return SDM_OK;
}

/* Refuses options that would do nothing. */
static sdm_status check_options(const cli_args *args, sdm_error *err)
{
    const cli_phantom_args *a = &args->phantom;
    const sdm_status useless = check_image_options(args, err);
    if (useless) return useless;
    if (!isnan(a->air[0]) && isnan(a->air_cells[0]))
        return sdm_fail(err, SDM_E_ARG,
                        "phantom: --air does nothing without --air-cells SHARE,MM,CLEAR");
    if (a->white_noise && a->noise <= 0)
        return sdm_fail(err, SDM_E_ARG, "phantom: --white-noise does nothing with --noise 0");
    if ((a->surface_points || !isnan(a->surface_noise)) &&
        !(a->surface && cli_ends_with_any(a->surface, ".csv .npy")))
        return sdm_fail(err, SDM_E_ARG,
                        "phantom: --surface-%s does nothing without --surface FILE.csv or FILE.npy",
                        a->surface_points ? "points" : "noise");
    return SDM_OK;
}

sdm_status cli_phantom_setup(cli_phantom *p, sdm_error *err)
{
    sdm_mesh mesh = {0};
    const sdm_status useless = check_options(p->args, err);
    if (useless) return useless;
    read_options(p);
    sdm_status s = cli_shape_open(p->args, p->args->shape, &p->args->options, &p->shape, err);
    if (!s) s = draw_params(p, err);
    if (!s) s = read_pose(p, err);
    if (!s) s = sdm_instance_mesh(p->shape.instance, p->shape.values, &mesh, err);
    if (!s) s = grid_make(p, &mesh, err);
    const bool drawn = p->args->outputs.n || p->args->phantom.label;
    if (!s) p->thin = cli_warn_mesh(&mesh, drawn ? sdm_grid_coarsest(&p->grid) : 0, CLI_MEND_SHAPE);
    sdm_mesh_dispose(&mesh);
    return s;
}
