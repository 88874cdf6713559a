/* A position in a spline: its index in the map, and the taps (coefficients with their weights) that
   it depends on (spline.h). Internal to the room `field`. */
#pragma once

#include <stdint.h>

/* Indices are rounded to multiples of 1 / SPLINE_STEPS, so that the fraction is exact as float and
   roundings of world coordinates do not matter. */
#define SPLINE_STEPS 16777216.0

/* A position along an axis. */
typedef struct spline_place {
    int32_t cell;  /* the first of the four coefficients */
    int32_t node;  /* the voxel whose centre lies here, -1: none */
    float t;       /* 0 .. 1, from voxel `cell` to the next one */
    double beyond; /* index units from the end of the box to the position, with sign; 0: inside */
} spline_place;

/* The map from world coordinates (mm) to indices: index = to_index (world - origin), row-major. */
typedef struct spline_frame {
    double origin[3], to_index[9], spacing[3], dir[9];
} spline_frame;

/* index[3] = the index of a world position. */
static inline void sdm_spline_index(const spline_frame *f, const double world[3], double index[3])
{
    const double d[3] = {world[0] - f->origin[0], world[1] - f->origin[1], world[2] - f->origin[2]};
    for (int a = 0; a < 3; a++)
        index[a] = f->to_index[3 * a] * d[0] + f->to_index[3 * a + 1] * d[1] +
                   f->to_index[3 * a + 2] * d[2];
}

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
