/* Sets the start pose of a fit and the rotations to try. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/memory.h"

enum { TURNS_ABOUT_AXIS = 12, TURNS_ALL = 60 };

/* The default centre of the shape: the middle of the points, labels, region or image, in the
 * world. */
static void default_centre(const cli_fit *f, double centre[3])
{
    const sdm_grid *g = &f->target.grid;
    if (f->target.kind == SDM_FIT_POINTS) {
        const size_t n = f->target.n_points;
        for (int a = 0; a < 3; a++) centre[a] = 0;
        for (size_t i = 0; i < 3 * n; i++) centre[i % 3] += f->points[i] / (double)n;
        return;
    }
    double index[3] = {0.5 * (double)(g->n[0] - 1), 0.5 * (double)(g->n[1] - 1),
                       0.5 * (double)(g->n[2] - 1)};
    if (f->target.kind == SDM_FIT_LABEL) {
        double sum[3] = {0, 0, 0}, count = 0;
        const float *v = f->mask;
        for (int64_t k = 0; k < g->n[2]; k++)
            for (int64_t j = 0; j < g->n[1]; j++)
                for (int64_t i = 0; i < g->n[0]; i++) {
                    if (!(*v++ > 0)) continue;
                    sum[0] += (double)i, sum[1] += (double)j, sum[2] += (double)k;
                    count++;
                }
        for (int a = 0; a < 3; a++) index[a] = sum[a] / count;
    }
    sdm_grid_world(g, index, centre);
    if (f->target.kind == SDM_FIT_IMAGE && f->opts.use_box)
        for (int a = 0; a < 3; a++) centre[a] = 0.5 * (f->opts.box_min[a] + f->opts.box_max[a]);
}

/* out = a point or direction that was given on the command line, converted to LPS. */
static void convert_to_lps(const cli_fit *f, const double given[3], double out[3])
{
    memcpy(out, given, 3 * sizeof *out);
    if (f->args->fit.ras) cli_fit_negate_xy(out, 1);
}

/* --start-points: the pose that brings the points of the shape nearest to those of the image. */
static sdm_status pose_from_points(const cli_fit *f, sdm_pose *pose, sdm_error *err)
{
    static const sdm_param columns[6] = {{.name = "shape_x"}, {.name = "shape_y"},
                                         {.name = "shape_z"}, {.name = "x"},
                                         {.name = "y"},       {.name = "z"}};
    const double none[6] = {NAN, NAN, NAN, NAN, NAN, NAN};
    // read the pairs
    const char *path = f->args->fit.start_points;
    double *rows = NULL, *shape = NULL, *world = NULL;
    size_t n = 0;
    sdm_status s = cli_read_rows(path, columns, 6, none, &(cli_list){0}, &rows, NULL, &n, err);
    if (!s) s = SDM_ALLOC(&shape, 3 * n, "points", err);
    if (!s) s = SDM_ALLOC(&world, 3 * n, "points", err);
    for (size_t i = 0; i < 6 * n && !s; i++) {
        if (!isfinite(rows[i]))
            s = sdm_fail(err, SDM_E_FORMAT, "%s: %s of pair %zu is missing or not finite", path,
                         columns[i % 6].name, i / 6 + 1);
        (i % 6 < 3 ? shape : world)[i / 6 * 3 + i % 3] = rows[i];
    }
    // align them
    if (!s && f->args->fit.ras) cli_fit_negate_xy(world, n);
    if (!s) s = sdm_fit_pose_from_points(shape, world, n, pose, err);
    if (s == SDM_E_ARG) {
        s = sdm_fail_in(err, SDM_E_FORMAT, "%s", path);
        if (err) err->status = s;
    }
    sdm_free(world);
    sdm_free(shape);
    sdm_free(rows);
    return s;
}

/* --find makes the start: refuses options that state one. */
static sdm_status check_find(const cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    const cli_pose_args *p = &f->args->pose;
    if (a->candidates && !a->find)
        return sdm_fail(err, SDM_E_ARG, "fit: --candidates belongs to --find");
    const struct {
        const char *option;
        bool given;
    } rows[] = {{"--rotation", !isnan(p->rotation[0])},
                {"--translation", !isnan(p->translation[0])},
                {"--start-centre", !isnan(a->start_centre[0])},
                {"--start-axis", !isnan(a->start_axis[0])},
                {"--start-points", a->start_points != NULL},
                {"--turns", a->turns > 0},
                {"--turns-sphere", a->turns_sphere > 0},
                {"--keep pose", f->opts.keep_pose}};
    for (size_t i = 0; a->find && i < sizeof rows / sizeof *rows; i++)
        if (rows[i].given)
            return sdm_fail(err, SDM_E_ARG,
                            "fit: --find searches for the start: leave %s out, or --find",
                            rows[i].option);
    return SDM_OK;
}

/* Refuses options that contradict each other. */
static sdm_status check_start_options(const cli_fit *f, sdm_error *err)
{
    const cli_fit_args *a = &f->args->fit;
    const cli_pose_args *p = &f->args->pose;
    const int turned = !isnan(p->rotation[0]) + !isnan(a->start_axis[0]) + !!a->start_points;
    const int placed = !isnan(p->translation[0]) + !isnan(a->start_centre[0]) + !!a->start_points;
    if (turned > 1)
        return sdm_fail(err, SDM_E_ARG,
                        "fit: give one of --rotation, --start-axis and --start-points");
    if (placed > 1)
        return sdm_fail(err, SDM_E_ARG,
                        "fit: give one of --translation, --start-centre and --start-points");
    if (!isnan(a->start_axis[0]) && !isnan(p->translation[0]))
        return sdm_fail(
            err, SDM_E_ARG,
            "fit: --start-axis goes with --start-centre, --rotation with --translation");
    if (a->turns && a->turns_sphere)
        return sdm_fail(err, SDM_E_ARG, "fit: give one of --turns and --turns-sphere");
    return SDM_OK;
}

/* Sets the number of rotations to try and their axes. With a given start rotation no other
 * rotations are tried unless an option sets their number. */
static void read_turns(cli_fit *f, bool has_rotation)
{
    const cli_fit_args *a = &f->args->fit;
    const bool has_axis = !isnan(a->start_axis[0]);
    memcpy(f->opts.pivot, f->pivot, sizeof f->pivot);
    if (a->turns || (has_axis && !a->turns_sphere)) {
        f->opts.turns = SDM_FIT_TURNS_AXIS;
        f->opts.n_turns = a->turns ? (size_t)a->turns : TURNS_ABOUT_AXIS;
    } else if (a->turns_sphere || !has_rotation) {
        f->opts.turns = SDM_FIT_TURNS_SPHERE;
        f->opts.n_turns = a->turns_sphere ? (size_t)a->turns_sphere : TURNS_ALL;
    }
    if (f->opts.keep_pose) f->opts.turns = SDM_FIT_TURNS_NONE;
}

/* The start pose with the middle of the shape at `centre` and the rotation of --start-axis or
 * --rotation; without these options it has no rotation. */
static sdm_status pose_from_centre(cli_fit *f, const double centre[3], sdm_error *err)
{
    const cli_pose_args *p = &f->args->pose;
    sdm_pose *pose = &f->opts.start_pose;
    if (!isnan(f->args->fit.start_axis[0])) {
        double axis[3];
        convert_to_lps(f, f->args->fit.start_axis, axis);
        return sdm_fit_pose_from_axis(f->pivot, centre, axis, pose, err);
    }
    double moved[3];
    *pose = (sdm_pose){{0, 0, 0}, {0, 0, 0}};
    if (!isnan(p->rotation[0])) memcpy(pose->rotation, p->rotation, sizeof pose->rotation);
    sdm_pose_apply(pose, f->pivot, moved);
    for (int a = 0; a < 3; a++) pose->translation[a] = centre[a] - moved[a];
    return SDM_OK;
}

/* Tells what the program chooses where the command line gives no place or no rotation. */
static void notice_start(const cli_fit *f, const double centre[3])
{
    const cli_fit_args *a = &f->args->fit;
    const bool given = !isnan(a->start_centre[0]),
               turned = f->opts.turns == SDM_FIT_TURNS_SPHERE && !a->turns_sphere;
    const char *place = given                             ? "start centre"
                        : f->target.kind != SDM_FIT_IMAGE ? cli_fit_kind(f)
                        : f->opts.use_box                 ? "region"
                                                          : "image";
    char at[120];
    snprintf(at, sizeof at, "%s%s, %.4g, %.4g, %.4g mm (LPS)", given ? "" : "middle of the ", place,
             centre[0], centre[1], centre[2]);
    if (turned)
        cli_notice("no start rotation is given: %zu rotations are tried about the %s; --start-axis "
                   "or --rotation make the search shorter",
                   f->opts.n_turns, at);
    else if (!given && f->target.kind == SDM_FIT_IMAGE)
        cli_notice("no start centre is given: the shape starts in the %s", at);
}

sdm_status cli_fit_read_start(cli_fit *f, sdm_error *err)
{
    const cli_pose_args *p = &f->args->pose;
    const bool has_translation = !isnan(p->translation[0]),
               has_centre = !isnan(f->args->fit.start_centre[0]);
    const bool has_points = f->args->fit.start_points;
    double centre[3];
    sdm_status s = check_find(f, err);
    if (!s) s = check_start_options(f, err);
    if (!s) s = sdm_fit_centre(&f->source, f->start, f->pivot, err);
    if (s || f->args->fit.find) return s;
    read_turns(f, has_points || has_translation || !isnan(p->rotation[0]));
    if (has_points) return pose_from_points(f, &f->opts.start_pose, err);
    if (has_translation) {
        for (int a = 0; a < 3; a++)
            f->opts.start_pose.rotation[a] = isnan(p->rotation[a]) ? 0 : p->rotation[a];
        memcpy(f->opts.start_pose.translation, p->translation, sizeof p->translation);
        return SDM_OK;
    }
    if (has_centre)
        convert_to_lps(f, f->args->fit.start_centre, centre);
    else
        default_centre(f, centre);
    notice_start(f, centre);
    return pose_from_centre(f, centre, err);
}
