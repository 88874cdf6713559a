/* Features and the regions in which they can be the nearest. Part of the map kernels. */
#ifndef SDM_GEOM_FEATURES_KERNEL_H
#define SDM_GEOM_FEATURES_KERNEL_H

#include "bounds_kernel.h"

/* The functions of a feature at eight points. */
typedef struct functions8 {
    v8f f[4];
} functions8;

/* How far the worst of them is beyond what is most in the region of a face or edge: at most 0 inside. most: of one feature, eight floats
   from function to function. */
SDM_FOR_KIND v8f beyond(int kind, const functions8 *x, const float *most)
{
    const v8f first = kind == SDM_EDGES ? v8_abs(x->f[0]) : x->f[0];
    const v8f all = v8_max(first - v8_all(most[0]), v8_max(x->f[1] - v8_all(most[8]), x->f[2] - v8_all(most[16])));
    return kind == SDM_THIN_FACES ? v8_max(all, x->f[3] - v8_all(most[24])) : all;
}

/* How far eight points are beyond the region of a corner; x: from it to them. */
static inline v8f beyond_corner(const sdm_corner_row *k, point8 x)
{
    v8f most = v8_all(-INFINITY);
    for (int j = 0; j < SDM_CORNER_EDGES; j++)
        most = v8_max(most, p8_dot(p8_all(k->along[0][j], k->along[1][j], k->along[2][j]), x));
    return most;
}

/* The same of parts around the points, less what it changes to their corners. */
static inline v8f beyond_corner_part(const sdm_grid_parts *q, bool aligned, const sdm_corner_row *k, float error,
                                     point8 x)
{
    _Alignas(32) float reach[8];
    v8_store(reach, extent(q, aligned, p8_load(k->along)) + v8_all(error));
    v8f most = v8_all(-INFINITY);
    for (int j = 0; j < SDM_CORNER_EDGES; j++)
        most = v8_max(most, p8_linear(p8_all(k->along[0][j], k->along[1][j], k->along[2][j]), x, v8_all(-reach[j])));
    return most;
}

#endif
