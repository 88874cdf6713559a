/* Cubic B-splines on a grid: their coefficients. Internal to the room `field`.

   A spline of a map of n voxels along an axis has n + 2 coefficients along it, one beyond each end,
   and at least 4. A position with the index i in the map, between the voxels m and m + 1, depends
   on the coefficients m .. m + 3, which are those of the voxels m - 1 .. m + 2. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"
#include "spline_place.h"

typedef struct spline_shape {
    int64_t n[3];     /* voxels of the map */
    size_t padded[3]; /* coefficients along each axis */
    size_t step[3];   /* distance of neighbouring coefficients along each axis */
    size_t count;     /* coefficients in all */
} spline_shape;

/* Places of the voxels of a grid along one of its axes, which is parallel to an axis of the map. */
typedef struct spline_axis {
    size_t n;
    int axis;           /* of the map */
    int32_t *cell;      /* [n] as in spline_place */
    int32_t *node;      /* [n] as in spline_place */
    float (*weight)[4]; /* [n] weights of the coefficients cell .. cell + 3 */
    float *beyond;      /* [n] distance from the end of the box to the voxel, mm; 0: inside */
    int32_t low, high;  /* the coefficients in use: low .. high - 1 */
    bool leaves;        /* a voxel lies outside of the box */
} spline_axis;

/* The shape of the spline of a map of n[3] voxels. */
spline_shape sdm_spline_shape(const int64_t n[3]);

/* Floats of scratch memory of sdm_spline_fit(). */
size_t sdm_spline_scratch(const spline_shape *s, int n_threads);

/* coefficient[count] = those of the spline that interpolates values[nz][ny][nx].
   scratch[sdm_spline_scratch()], 64-byte aligned. The same bits for any number of threads. */
void sdm_spline_fit(const spline_shape *s, const float *values, int n_threads, float *scratch,
                    float *coefficient);
