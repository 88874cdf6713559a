/* Bounds on the change of a spline over short distances. Internal to the room `field`. */
#pragma once

#include "spline.h"

/* Cells (the boxes between neighbouring voxels) of a brick along each axis. */
#define SPLINE_BRICK 2

/* max[n[2]][n[1]][n[0]]: the largest change of the spline between two points of a brick that are at
   most reach[a] voxels of the map apart along each axis a; if the points lie in different bricks,
   the largest number of the bricks between them counts. all: the largest number of all. Bricks that
   are not asked for have 0. */
typedef struct spline_change {
    size_t n[3];
    float *max, all;
} spline_change;

/* Rows of bricks, first .. last - 1, of a layer. */
typedef struct brick_rows {
    size_t first, last;
} brick_rows;

/* Bricks along each axis. */
void sdm_spline_bricks(const spline_shape *s, size_t n[3]);

/* The derivative of a cubic spline along an axis is a weighted mean of the differences of its
   coefficients along this axis (de Boor 1972), so the largest difference with an influence in the
   brick bounds it. asked[n[2]]: the bricks of each layer that are needed; NULL: all. Call
   sdm_spline_change_dispose() also after an error. SDM_E_NOMEM. */
sdm_status sdm_spline_change_create(const spline_shape *s, const double reach[3],
                                    const float *coefficient, const brick_rows *asked,
                                    int n_threads, spline_change *out, sdm_error *err);
void sdm_spline_change_dispose(spline_change *b);
