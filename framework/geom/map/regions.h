/* Features and the regions in which they can be the nearest. Part of the map kernels. */
#ifndef SDM_GEOM_FEATURES_KERNEL_H
#define SDM_GEOM_FEATURES_KERNEL_H

#include "stage1_bounds.h"

SDM_FOR_KIND int functions_of(int kind) { return kind == SDM_CORNERS ? SDM_FUNCTIONS : 4; }

/* From the lane of a feature in the first of rows of eight floats, `rows` of them for a function of
 * the group, to its function k. */
SDM_FOR_KIND int place_of(int kind, int k, int rows)
{
    return kind == SDM_CORNERS ? 8 * rows * (k % 3) + SDM_CORNER_LANES * (k / 3) : 8 * rows * k;
}

/* The functions of a feature at eight points. */
typedef struct functions8 {
    v8f f[SDM_FUNCTIONS];
} functions8;

/* How far the worst of a feature's functions at the middles of parts is beyond what is most in its
   region, less what it changes within the part: at most the error of a function where the part
   meets the region. sum: as in a group, in the feature's lane; less: half extents of the part with
   the other sign. */
SDM_FOR_KIND v8f beyond(int kind, const functions8 *x, const float *sum, v8f less,
                        const float most[2])
{
    v8f all = x->f[0];
    for (int k = 0;
         k < functions_of(kind) && (k < 3 || kind == SDM_THIN_FACES || kind == SDM_CORNERS); k++) {
        v8f f = kind == SDM_EDGES && k == 0 ? v8_abs(x->f[0]) : x->f[k];
        if (kind == SDM_EDGES && k < 2) f = v8_sub(f, v8_all(most[k]));
        f = v8_fma(less, v8_all(sum[place_of(kind, k, 1)]), f);
        all = k ? v8_max(all, f) : f;
    }
    if (kind != SDM_EDGES) return all;
    const v8f mean = v8_sub(v8_mul(v8_add(x->f[1], x->f[2]), v8_all(0.5f)), v8_all(most[1]));
    return v8_max(all, v8_fma(less, v8_all(sum[24]), mean));
}

#endif
