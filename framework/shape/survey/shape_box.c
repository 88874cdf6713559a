/* The box that holds the shapes of a family. */
#include "sdm/internal/shape_box.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/mesh_box.h"
#include "shape_family.h"

enum { SEARCH_ROUNDS = 4 };

/* The box, and for each of its six sides the shape that reaches farthest: side 2 i + 1 is the upper
 * one along axis i, and its reach is the highest coordinate; that of a lower side is the negative
 * of the lowest. */
typedef struct shape_box {
    double reach[6], at[6][SHAPE_PARAMS_MAX];
    sdm_mesh mesh;
} shape_box;

/* Extends the box by the mesh at p. */
static sdm_status box_extend(shape_box *b, const shape_family *f, const double *p, sdm_error *err)
{
    const sdm_status s = sdm_instance_mesh(f->shape, p, &b->mesh, err);
    if (s) return s;
    sdm_box box = SDM_BOX_EMPTY;
    sdm_box_add_mesh(&box, &b->mesh);
    for (size_t k = 0; k < 6; k++) {
        const double reach = k % 2 ? box.max[k / 2] : -box.min[k / 2];
        if (!(reach > b->reach[k])) continue;
        b->reach[k] = reach;
        memcpy(b->at[k], p, f->shape->n_params * sizeof *p);
    }
    return SDM_OK;
}

/* Pattern search (Hooke and Jeeves 1961) from the farthest shape of each side, one uniformly
 * distributed parameter at a time: an arm with joints reaches farthest within its ranges. */
static sdm_status box_search(shape_box *b, const shape_family *f, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (int round = 0; round < SEARCH_ROUNDS; round++) {
        const double part = ldexp(0.25, -round);
        for (size_t k = 0; k < 6; k++) {
            for (size_t i = 0; i < 2 * f->shape->n_params && !s; i++) {
                double p[SHAPE_PARAMS_MAX];
                const size_t at = i / 2;
                const double step = (i % 2 ? part : -part) * (f->max[at] - f->min[at]);
                if (f->distribution[at].kind != SDM_DISTRIBUTION_UNIFORM) continue;
                memcpy(p, b->at[k], f->shape->n_params * sizeof *p);
                p[at] = fmin(fmax(p[at] + step, f->min[at]), f->max[at]);
                s = box_extend(b, f, p, err);
            }
        }
    }
    return s;
}

sdm_status sdm_shape_box(const sdm_instance *shape, const double (*range)[2], size_t samples,
                         uint64_t seed, double low[3], double high[3], sdm_error *err)
{
    if (!shape || !low || !high)
        return sdm_fail(err, SDM_E_ARG, "a box needs a shape and a place for its two corners");
    shape_family f;
    sdm_status s = sdm_family_set(&f, shape, range, NULL, seed, err);
    if (s) return s;
    const size_t n = shape->n_params;
    double p[SHAPE_PARAMS_MAX];
    shape_box b = {0};
    for (int k = 0; k < 6; k++) b.reach[k] = -INFINITY;
    for (size_t i = 0; i < n; i++) p[i] = f.min[i] + 0.5 * (f.max[i] - f.min[i]);
    s = box_extend(&b, &f, p, err);
    for (size_t k = 0; k < f.n_corners && !s; k++) {
        sdm_family_corner(&f, k, p);
        s = box_extend(&b, &f, p, err);
    }
    for (size_t k = 0; k < samples && !s; k++) {
        sdm_family_sample(&f, k, p);
        s = box_extend(&b, &f, p, err);
    }
    if (!s) s = box_search(&b, &f, err);
    sdm_mesh_dispose(&b.mesh);
    for (int i = 0; i < 3 && !s; i++) low[i] = -b.reach[2 * i], high[i] = b.reach[2 * i + 1];
    return s;
}
