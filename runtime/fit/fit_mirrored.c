/* The fit of a shape to the mirror image of a target, which is the fit of the mirrored shape to the
 * target: the world is reflected in x, the shape in its own y. */
#include <math.h>
#include <string.h>

#include "fit_rival.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rotation.h"

// the target reflected in x; *values, *points: memory of its data
static sdm_status target_reflect(const sdm_fit_target *t, sdm_fit_target *out, float **values,
                                 double **points, sdm_error *err)
{
    *out = *t;
    if (t->kind == SDM_FIT_POINTS) {
        const sdm_status s = SDM_ALLOC(points, 3 * t->n_points, "points", err);
        for (size_t i = 0; i < 3 * t->n_points && !s; i++)
            (*points)[i] = i % 3 ? t->points[i] : -t->points[i];
        out->points = *points;
        return s;
    }
    // the first axis of the image is reversed, so that its axes stay right-handed
    sdm_grid *g = &out->grid;
    const size_t nx = (size_t)g->n[0], n = sdm_grid_count(g);
    double last[3];
    sdm_grid_world(g, (const double[3]){(double)(nx - 1), 0, 0}, last);
    memcpy(g->origin, last, sizeof last);
    g->origin[0] = -g->origin[0];
    for (int a = 0; a < 3; a++) g->dir[3 * a] = -g->dir[3 * a];
    for (int b = 0; b < 3; b++) g->dir[b] = -g->dir[b];
    const sdm_status s = SDM_ALLOC(values, n, "image", err);
    for (size_t i = 0; i < n && !s; i++) (*values)[i] = t->values[i / nx * nx + nx - 1 - i % nx];
    out->values = *values;
    return s;
}

// W R S with W = diag(-1, 1, 1) and S = diag(1, -1, 1); the pivot goes to its reflected place
static void pose_reflect(const sdm_pose *pose, const double pivot[3], sdm_pose *out)
{
    double r[9], at[3], moved[3];
    sdm_pose_apply(pose, pivot, at);
    at[0] = -at[0];
    sdm_pose_matrix(pose, r);
    for (int i = 0; i < 3; i++) {
        r[i] = -r[i];
        r[3 * i + 1] = -r[3 * i + 1];
    }
    *out = (sdm_pose){{0, 0, 0}, {0, 0, 0}};
    sdm_rotation_vector(r, out->rotation);
    sdm_pose_apply(out, pivot, moved);
    for (int i = 0; i < 3; i++) out->translation[i] = at[i] - moved[i];
}

sdm_status sdm_fit_mirrored(const sdm_fit_source *source, const sdm_fit_target *target,
                            const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "fit: a place for the result is needed");
    *out = (sdm_fit_result){0};
    if (!target || !opts || (target->kind == SDM_FIT_POINTS ? !target->points : !target->values))
        return sdm_fail(err, SDM_E_ARG, "fit: a target and options are needed");
    sdm_status s = target->kind == SDM_FIT_POINTS ? SDM_OK : sdm_grid_check(&target->grid, err);
    sdm_fit_target reflected;
    sdm_fit_opts o = *opts;
    float *values = NULL;
    double *points = NULL, centre[3] = {0, 0, 0};
    if (!s) s = sdm_pose_check(&opts->start_pose, err);
    if (!s) s = target_reflect(target, &reflected, &values, &points, err);
    if (!s) s = sdm_fit_centre(source, opts->start_params, centre, err);
    if (!s) {
        pose_reflect(&opts->start_pose, centre, &o.start_pose);
        o.box_min[0] = -opts->box_max[0];
        o.box_max[0] = -opts->box_min[0];
        s = sdm_fit_rival(source, &reflected, &o, out, err);
    }
    sdm_free(values);
    sdm_free(points);
    return s;
}
