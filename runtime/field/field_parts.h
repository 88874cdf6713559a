/* The inside of a field, and its value at one point. Internal to the room `field`. */
#pragma once

#include <math.h>

#include "maps/shape_surface.h"
#include "sdm/field.h"
#include "sdm/internal/exact_slopes.h"
#include "spline_grid.h"
#include "spline_kernels.h"

struct sdm_field {
    const sdm_model *model;
    const sdm_model_info *info;
    sdm_grid grid; /* of the map in use: the model's, or that of its fine level */
    sdm_generate_opts opts;
    int n_threads;
    bool derivatives;
    /* The map and its splines. */
    spline_shape shape;
    spline_frame frame;
    const spline_table *kernels;
    size_t voxels;
    float *maps;    /* [1 + n_params or 1][voxels]: the map, then its derivatives */
    float *splines; /* [the same][shape.count] */
    float *scratch; /* scratch memory of sdm_spline_fit() */
    /* The parameters in use. */
    bool ready;
    double *params, *used; /* [n_params] as given; as the network takes them */
    sdm_result result;
    shape_surface surface;    /* without an engine if these parameters do not need it */
    sdm_exact_slopes *slopes; /* derivatives of exact distances; NULL: not known */
};

/* A point in the splines of a field. */
typedef struct field_place {
    size_t at; /* the first coefficient */
    float t[3], weight[3][4];
    int64_t node;    /* voxel of the map, -1: none */
    float beyond[3]; /* mm along the axes of the map, with sign */
    bool outside;
} field_place;

/* The place of a point with finite coordinates. */
static inline field_place field_find(const sdm_field *f, const double x[3])
{
    field_place p = {0};
    double index[3];
    int64_t node[3];
    sdm_spline_index(&f->frame, x, index);
    for (int a = 0; a < 3; a++) {
        const spline_place at = sdm_spline_place(index[a], f->shape.n[a]);
        p.at += (size_t)at.cell * f->shape.step[a];
        p.t[a] = at.t;
        sdm_spline_weights(at.t, p.weight[a]);
        node[a] = at.node;
        p.beyond[a] = (float)(at.beyond * f->frame.spacing[a]);
        p.outside = p.outside || at.beyond != 0;
    }
    p.node = node[0] < 0 || node[1] < 0 || node[2] < 0
                 ? -1
                 : (node[2] * f->shape.n[1] + node[1]) * f->shape.n[0] + node[0];
    return p;
}

/* The map (0) or its derivative by parameter `map` - 1 at a place; outside of the box, that at the
   nearest point of the box. */
static inline float field_inside(const sdm_field *f, const field_place *p, size_t map)
{
    if (p->node >= 0) return f->maps[map * f->voxels + (size_t)p->node];
    return f->kernels->value(f->splines + map * f->shape.count + p->at, f->shape.step[1],
                             f->shape.step[2], (const float(*)[4])p->weight);
}

/* The square of the distance to the box. */
static inline float field_square(const float beyond[3])
{
    return (beyond[0] * beyond[0] + beyond[1] * beyond[1]) + beyond[2] * beyond[2];
}

/* The bound of sdm/field.h, from the distance d at the nearest point of the box. */
static inline float field_bound(float d, float square)
{
    return sqrtf(d > 0 ? square + d * d : square);
}

/* The value by the network at a point, with the bound outside of the box. */
static inline float field_value(const sdm_field *f, const field_place *p)
{
    const float d = field_inside(f, p, 0);
    return p->outside ? field_bound(d, field_square(p->beyond)) : d;
}

/* Does the exact engine compute all values of this field, and the network none? */
static inline bool field_is_exact(const sdm_field *f)
{
    return f->result.source == SDM_SOURCE_EXACT;
}

/* SDM_E_RANGE for a point outside of the box; `what` is its description. */
sdm_status sdm_field_refuse(const sdm_field *f, const char *what, sdm_error *err);

/* SDM_E_ARG without parameters, or for slopes without derivatives. */
sdm_status sdm_field_check(const sdm_field *f, const float *slopes, sdm_error *err);

/* Whether a grid leaves the box. */
bool sdm_field_leaves(const sdm_field *f, const sdm_grid *grid);

/* Values beyond the box, at the places of a parallel grid: those of the nearest points of the box
   become the bound. With slopes (not NULL, the derivatives by one parameter), the slopes become
   those of the bound, and values stay: they are those at the nearest points of the box. */
void sdm_field_bound(const sdm_field *f, const spline_grid *g, float *values, float *slopes);
