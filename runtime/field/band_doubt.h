/* Blocks of a band that coefficients of the spline do not exclude. Internal to the room `field`. */
#pragma once

#include "spline.h"
#include "spline_change.h"

/* The bricks (of spline_change.h) that a block meets along an axis of the map, low .. high, and
   whether voxels of it may lie outside of the box. */
typedef struct brick_span {
    size_t low, high;
    bool leaves;
} brick_span;

/* Blocks along an axis of a parallel grid. */
typedef struct block_axis {
    int axis; /* of the map */
    size_t n;
    const brick_span *span; /* [n] */
} block_axis;

/* doubt[nz][ny][nx] = 1 for the blocks with a voxel that may have abs(value) <= limit, or may have
   values of both signs; 0 for others. axis[3]: x, y, z of the grid. The values of a spline are
   weighted means of its coefficients, so those of a block lie beyond the limit where all
   coefficients with an influence do. SDM_E_NOMEM. */
sdm_status sdm_band_doubt(const spline_shape *s, const float *coefficient, float limit,
                          const block_axis axis[3], int n_threads, uint8_t *doubt, sdm_error *err);
