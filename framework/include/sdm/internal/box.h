/* Bounding boxes. */
#pragma once

#include <math.h>
#include <stddef.h>

#include "sdm/grid.h"

typedef struct sdm_box {
    double min[3], max[3];
} sdm_box;

/* The box of no point. */
static const sdm_box SDM_BOX_EMPTY = {{INFINITY, INFINITY, INFINITY},
                                      {-INFINITY, -INFINITY, -INFINITY}};

/* Extends the box to the point x. */
static inline void sdm_box_add(sdm_box *b, const double x[3])
{
    for (int a = 0; a < 3; a++) {
        // a comparison with NaN is false
        if (x[a] < b->min[a]) b->min[a] = x[a];
        if (x[a] > b->max[a]) b->max[a] = x[a];
    }
}

/* Extends the box to the points x[n][3]. */
static inline void sdm_box_add_points(sdm_box *b, const double *x, size_t n)
{
    for (size_t i = 0; i < n; i++) sdm_box_add(b, x + 3 * i);
}

/* The box of the voxel centres, along the world axes. */
static inline sdm_box sdm_box_of_grid(const sdm_grid *g)
{
    sdm_box b = SDM_BOX_EMPTY;
    sdm_box_add(&b, g->origin);
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++) {
            const double edge = g->dir[3 * a + i] * g->spacing[i] * (double)(g->n[i] - 1);
            *(edge < 0 ? &b.min[a] : &b.max[a]) += edge;
        }
    return b;
}
