/* Follows the rotations of parts along paths in the parameter space. */
#include "rotations.h"

#include <math.h>
#include <string.h>

#include "motion.h"
#include "template_parts.h"

/* Steps of a path; a rotation must change by less than half a turn in each. */
enum { STEPS = 16 };

/* Rotation vectors longer than this one are unwrapped, rad. */
static const double LONG = 3;

// w[3] := the vector of the same rotation that is nearest to `before`: w + 2 pi k w / |w|.
static void nearest_branch(const double before[3], double w[3])
{
    const double turn = 2 * 3.14159265358979323846;
    double length = 0, along = 0, axis[3];
    for (int a = 0; a < 3; a++) length += w[a] * w[a];
    length = sqrt(length);
    if (length > 1e-6) {
        for (int a = 0; a < 3; a++) axis[a] = w[a] / length;
    } else { // no rotation or whole turns: any axis will do
        double own = 0;
        for (int a = 0; a < 3; a++) own += before[a] * before[a];
        for (int a = 0; a < 3; a++) axis[a] = own > 0 ? before[a] / sqrt(own) : 0;
    }
    for (int a = 0; a < 3; a++) along += (before[a] - w[a]) * axis[a];
    const double turns = turn * round(along / turn);
    for (int a = 0; a < 3; a++) w[a] += turns * axis[a];
}

// Rotation vector of part c relative to its parent, for a mesh.
static void rotation_of(const template_design *d, size_t c, const double *vert, double w[3])
{
    motion own, parent, relative;
    double stretch[6];
    trainer_template_motion(d, c, vert, &own);
    if (d->parts[c].parent >= 0) {
        trainer_template_motion(d, (size_t)d->parts[c].parent, vert, &parent);
        trainer_motion_relative(&parent, &own, &relative);
        own = relative;
    }
    trainer_motion_polar(own.m, w, stretch);
}

// Sets wraps[c]: the rotations of part c are long somewhere. Returns true if there is such a part.
static bool find_long(const template_design *d, size_t n, const double *y, bool *wraps)
{
    bool any = false;
    for (size_t c = 0; c < d->n_parts; c++)
        for (size_t i = 0; i < n && d->parts[c].frame != SDM_FRAME_NONE && !wraps[c]; i++) {
            const double *w = y + i * d->n_numbers + d->parts[c].numbers;
            wraps[c] = w[0] * w[0] + w[1] * w[1] + w[2] * w[2] > LONG * LONG;
            any |= wraps[c];
        }
    return any;
}

sdm_status trainer_template_unwrap(const template_design *d, size_t n_samples, double *y,
                                   sdm_error *err)
{
    const family *f = &d->family;
    bool wraps[SDM_TEMPLATE_MAX_PARTS] = {false};
    if (!find_long(d, n_samples, y, wraps)) return SDM_OK;
    size_t n_params;
    const sdm_param *params = sdm_instance_params(f->shape, &n_params);
    sdm_mesh mesh = {0};
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < n_samples && !s; i++) {
        double to[SDM_POD_MAX_PARAMS], p[SDM_POD_MAX_PARAMS], w[SDM_TEMPLATE_MAX_PARTS][3] = {{0}};
        trainer_family_params(f, i, to);
        for (int step = 1; step <= STEPS && !s; step++) {
            for (size_t k = 0; k < n_params; k++) {
                const double from = fmin(fmax(params[k].def, f->min[k]), f->max[k]);
                p[k] = step == STEPS ? to[k] : from + (to[k] - from) * step / STEPS;
            }
            s = trainer_family_mesh(f, p, &mesh, err);
            for (size_t c = 0; c < d->n_parts && !s; c++) {
                if (!wraps[c]) continue;
                double next[3];
                rotation_of(d, c, mesh.vert, next);
                nearest_branch(w[c], next);
                memcpy(w[c], next, sizeof next);
            }
        }
        for (size_t c = 0; c < d->n_parts && !s; c++)
            if (wraps[c]) memcpy(y + i * d->n_numbers + d->parts[c].numbers, w[c], sizeof w[c]);
    }
    sdm_mesh_dispose(&mesh);
    return s;
}
