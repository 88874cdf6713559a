/* Features and the regions in which they can be the nearest. Part of the map kernels. */
#ifndef SDM_GEOM_FEATURES_KERNEL_H
#define SDM_GEOM_FEATURES_KERNEL_H

#include "bounds_kernel.h"

SDM_FOR_KIND int functions_of(int kind) { return kind == SDM_CORNERS ? SDM_FUNCTIONS : 4; }

/* From the lane of a feature in the first of rows of eight floats, `rows` of them for a function of the group, to its function k. */
SDM_FOR_KIND int place_of(int kind, int k, int rows)
{
    return kind == SDM_CORNERS ? 8 * rows * (k % 3) + SDM_CORNER_LANES * (k / 3) : 8 * rows * k;
}

/* The functions of a feature at eight points. */
typedef struct functions8 {
    v8f f[SDM_FUNCTIONS];
} functions8;

/* How far the worst of them is beyond what is most in the feature's region: at most 0 inside. most: of one feature, in its lane of a row for
   each function of the group. */
SDM_FOR_KIND v8f beyond(int kind, const functions8 *x, const float *most)
{
    v8f all = (kind == SDM_EDGES ? v8_abs(x->f[0]) : x->f[0]) - v8_all(most[0]);
    for (int k = 1; k < functions_of(kind) && (k < 3 || kind == SDM_THIN_FACES || kind == SDM_CORNERS); k++)
        all = v8_max(all, x->f[k] - v8_all(most[place_of(kind, k, 1)]));
    if (kind == SDM_EDGES) all = v8_max(all, x->f[1] + x->f[2] - v8_all(most[24]));
    return all;
}

#endif
