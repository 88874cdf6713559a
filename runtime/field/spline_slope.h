/* Bounds on the slope of a spline. Internal to the room `field`. */
#pragma once

#include "spline.h"

/* Cells (the boxes between neighbouring voxels) of a brick along each axis. */
#define SPLINE_BRICK 4

/* max[n[2]][n[1]][n[0]]: no gradient in a brick is longer, mm per mm. all: the largest of them. */
typedef struct spline_slope {
    size_t n[3];
    float *max, all;
} spline_slope;

/* The derivative of a cubic spline along an axis is a weighted mean of the differences of its
   coefficients along this axis, so the largest of them in reach of a brick bounds it (de Boor
   1972). spacing: of the map. Call sdm_spline_slope_dispose() also after an error. SDM_E_NOMEM. */
sdm_status sdm_spline_slope_create(const spline_shape *s, const double spacing[3],
                                   const float *coefficient, int n_threads, spline_slope *out,
                                   sdm_error *err);
void sdm_spline_slope_dispose(spline_slope *b);
