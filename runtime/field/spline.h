/* Cubic B-splines on a grid: coefficients, and the taps (coefficients with their weights) of a
   position. Internal to the room `field`.

   A spline of a map of n voxels along an axis has n + 2 coefficients along it, one beyond each end,
   and at least 4. A position with the index i in the map, between the voxels m and m + 1, depends
   on the coefficients m .. m + 3, which are those of the voxels m - 1 .. m + 2. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"

/* Indices are rounded to multiples of 1 / SPLINE_STEPS, so that the fraction is exact as float and
   roundings of world coordinates do not matter. */
#define SPLINE_STEPS 16777216.0

typedef struct spline_shape {
    int64_t n[3];     /* voxels of the map */
    size_t padded[3]; /* coefficients along each axis */
    size_t step[3];   /* distance of neighbouring coefficients along each axis */
    size_t count;     /* coefficients in all */
} spline_shape;

/* A position along an axis. */
typedef struct spline_place {
    int32_t cell;  /* the first of the four coefficients */
    int32_t node;  /* the voxel whose centre lies here, -1: none */
    float t;       /* 0 .. 1, from voxel `cell` to the next one */
    double beyond; /* index units from the end of the box to the position, with sign; 0: inside */
} spline_place;

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

/* The place of an index (a finite number) in an axis of n voxels. */
static inline spline_place sdm_spline_place(double index, int64_t n)
{
    const double last = (double)(n - 1);
    const double in = !(index > 0) ? 0 : index < last ? index : last;
    const int64_t q = (int64_t)(in * SPLINE_STEPS + 0.5), step = (int64_t)SPLINE_STEPS;
    const int64_t voxel = q / step, most = n > 2 ? n - 2 : 0, m = voxel < most ? voxel : most;
    const double out = index - in;
    return (spline_place){.cell = (int32_t)m,
                          .node = q % step ? -1 : (int32_t)voxel,
                          .t = (float)(q - m * step) * (float)(1 / SPLINE_STEPS),
                          .beyond =
                              out * SPLINE_STEPS > 0.5 || out * SPLINE_STEPS < -0.5 ? out : 0};
}

/* The weights of the four coefficients at t, and their derivatives by t. */
static inline void sdm_spline_weights(float t, float w[4])
{
    const float v = 1 - t, t2 = t * t, v2 = v * v;
    w[0] = v2 * v * (1.0f / 6);
    w[1] = 2.0f / 3 - t2 + 0.5f * (t2 * t);
    w[2] = 2.0f / 3 - v2 + 0.5f * (v2 * v);
    w[3] = t2 * t * (1.0f / 6);
}
static inline void sdm_spline_slopes(float t, float w[4])
{
    const float v = 1 - t, t2 = t * t, v2 = v * v;
    w[0] = -0.5f * v2;
    w[1] = 1.5f * t2 - 2 * t;
    w[2] = 2 * v - 1.5f * v2;
    w[3] = 0.5f * t2;
}
