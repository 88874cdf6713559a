/* Parameters, pose, grid and options of a phantom from the command line. */
#include <math.h>
#include <string.h>

#include "inputs/setup.h"
#include "phantom_command.h"
#include "report/terminal.h"
#include "sdm/memory.h"

static bool is_given(const cli_list *words, const char *name)
{
    const size_t length = strlen(name);
    for (size_t i = 0; i < words->n; i++)
        if (!strncmp(words->items[i], name, length) && words->items[i][length] == '=') return true;
    return false;
}

static sdm_status read_params(cli_phantom *p, sdm_error *err)
{
    const cli_args *args = p->args;
    const sdm_param *params = sdm_instance_params(p->shape, &p->n_params);
    double *drawn = NULL;
    sdm_status s = SDM_ALLOC(&p->params, p->n_params, "parameters", err);
    if (!s) s = SDM_ALLOC(&drawn, p->n_params, "parameters", err);
    if (!s) s = cli_read_params(params, p->n_params, &args->params, p->params, err);
    if (!s && args->phantom.random_params) {
        sdm_phantom_random_params(p->shape, p->opts.seed, drawn);
        for (size_t i = 0; i < p->n_params; i++)
            if (!is_given(&args->params, params[i].name)) p->params[i] = drawn[i];
    }
    sdm_free(drawn);
    return s;
}

/* The random pose comes after the given one: it is how far that one is off. */
static sdm_status read_pose(cli_phantom *p, sdm_error *err)
{
    const cli_phantom_args *a = &p->args->phantom;
    for (int i = 0; i < 3; i++) {
        p->pose.rotation[i] = isnan(a->rotation[i]) ? 0 : a->rotation[i];
        p->pose.translation[i] = isnan(a->translation[i]) ? 0 : a->translation[i];
    }
    if (isnan(a->random_pose[0])) return SDM_OK;
    if (a->random_pose[0] > 180)
        return sdm_fail(err, SDM_E_ARG, "--random-pose: a turn of %g degrees, need at most 180",
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

/* Vertices to the world, then to the axes of the image; min..max is their box there. */
static void to_frame(const cli_phantom *p, const sdm_pose *frame, sdm_mesh *mesh, double min[3],
                     double max[3])
{
    const sdm_pose back = sdm_pose_inverse(frame), all = sdm_pose_compose(&back, &p->pose);
    for (int i = 0; i < 3; i++) min[i] = INFINITY, max[i] = -INFINITY;
    for (size_t v = 0; v < mesh->n_vert; v++) {
        double *x = mesh->vert + 3 * v;
        sdm_pose_apply(&all, x, x);
        for (int i = 0; i < 3; i++) min[i] = fmin(min[i], x[i]), max[i] = fmax(max[i], x[i]);
    }
}

/* Ends the grid (in the image's frame) before the far end of the box, or begins it behind the near
 * end. */
static sdm_status crop(const cli_phantom *p, const double min[3], const double max[3], sdm_grid *g,
                       sdm_error *err)
{
    for (int i = 0; i < 3; i++) {
        const double share = p->args->phantom.crop[i], extent = max[i] - min[i], h = g->spacing[i];
        if (isnan(share) || share == 0) continue;
        const double last = g->origin[i] + (double)(g->n[i] - 1) * h;
        // voxels too many beyond the new end
        const double far =
            share > 0 ? last - (max[i] - share * extent) : min[i] - share * extent - g->origin[i];
        const int64_t drop = (int64_t)ceil(fmax(far / h, 0));
        if (p->args->size[i] > 0) {
            g->origin[i] += share > 0 ? -(double)drop * h : (double)drop * h;
            continue;
        }
        if (drop >= g->n[i])
            return sdm_fail(err, SDM_E_ARG, "--crop %g along %c leaves no voxel", share, "xyz"[i]);
        g->n[i] -= drop;
        if (share < 0) g->origin[i] += (double)drop * h;
    }
    return SDM_OK;
}

static sdm_status fit_grid(cli_phantom *p, sdm_mesh *mesh, sdm_error *err)
{
    const cli_args *args = p->args;
    const double *turn = args->phantom.frame;
    const bool placed = isfinite(args->origin[0]);
    const sdm_pose frame = {.rotation = {isnan(turn[0]) ? 0 : turn[0], isnan(turn[1]) ? 0 : turn[1],
                                         isnan(turn[2]) ? 0 : turn[2]}};
    double min[3], max[3];
    to_frame(p, &frame, mesh, min, max);
    if (placed && !isnan(args->phantom.crop[0]))
        return sdm_fail(
            err, SDM_E_ARG,
            "--crop and --origin exclude each other: the origin says where the grid is");
    sdm_status s = cli_fit_grid(args, min, max, &p->grid, err);
    if (s) return s;
    if (placed) // given in the world, and the grid is still in the image's frame
        sdm_pose_apply_inverse(&frame, p->grid.origin, p->grid.origin);
    s = crop(p, min, max, &p->grid, err);
    for (int i = 0; i < 3; i++) {
        const double end = p->grid.origin[i] + (double)(p->grid.n[i] - 1) * p->grid.spacing[i];
        p->cut |= min[i] < p->grid.origin[i] || max[i] > end;
    }
    sdm_pose_apply(&frame, p->grid.origin, p->grid.origin);
    sdm_pose_matrix(&frame, p->grid.dir);
    return s;
}

sdm_status cli_phantom_setup(cli_phantom *p, sdm_error *err)
{
    sdm_mesh mesh = {0};
    read_options(p);
    sdm_status s = read_params(p, err);
    if (!s) s = read_pose(p, err);
    if (!s) s = sdm_instance_mesh(p->shape, p->params, &mesh, err);
    if (!s) s = fit_grid(p, &mesh, err);
    sdm_mesh_dispose(&mesh);
    return s;
}
