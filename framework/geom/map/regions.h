/* Region functions of single features at eight points. Part of map.inc; sdm_feature_group in
   surface_features.h defines the functions and their layout. */
#pragma once

#include <assert.h>

#include "features/surface_features.h"
#include "grid_scratch.h"
#include "simd/lanes.h"

/* Number of region functions of a feature. */
SDM_FOR_KIND int functions_of(int kind) { return kind == SDM_CORNERS ? SDM_FUNCTIONS : 4; }

/* Row of function k in the arrays of a group, and its lane for the feature in lane `lane`: corners
   keep functions 3 to 5 in the upper half of rows 0 to 2. */
SDM_FOR_KIND int function_row(int kind, int k) { return kind == SDM_CORNERS ? k % 3 : k; }
SDM_FOR_KIND size_t function_lane(int kind, int k, size_t lane)
{
    assert(lane < (kind == SDM_CORNERS ? SDM_CORNER_LANES : 8));
    return kind == SDM_CORNERS ? lane + SDM_CORNER_LANES * (size_t)(k / 3) : lane;
}

/* Element of function k in an array [row][lane] of a group. */
SDM_FOR_KIND float function_value(int kind, const float (*x)[8], int k, size_t lane)
{
    return x[function_row(kind, k)][function_lane(kind, k, lane)];
}

/* Gradient of function k in all lanes of the result. */
SDM_FOR_KIND point8 function_gradient(int kind, const sdm_feature_group *group, int k, size_t lane)
{
    const float(*g)[8] = group->g[function_row(kind, k)];
    const size_t l = function_lane(kind, k, lane);
    return p8_all(g[0][l], g[1][l], g[2][l]);
}

/* The functions of one feature at eight points. */
typedef struct functions8 {
    v8f f[SDM_FUNCTIONS];
} functions8;

/* By how much eight parts lie outside a feature's region: the maximum over its functions of
   (value at the part's centre - largest value in the region - largest change within the part). A
   part meets the region only if the result is <= error. extent, lane: see sdm_block_feature.
   minus_half: -block.half of the parts. most: edges only. */
SDM_FOR_KIND v8f region_excess(int kind, const functions8 *x, const float (*extent)[8], size_t lane,
                               v8f minus_half, const float most[2])
{
    v8f all = x->f[0];
    for (int k = 0;
         k < functions_of(kind) && (k < 3 || kind == SDM_THIN_FACES || kind == SDM_CORNERS); k++) {
        v8f f = kind == SDM_EDGES && k == 0 ? v8_abs(x->f[0]) : x->f[k];
        if (kind == SDM_EDGES && k < 2) f = v8_sub(f, v8_all(most[k]));
        f = v8_fma(minus_half, v8_all(function_value(kind, extent, k, lane)), f);
        all = k ? v8_max(all, f) : f;
    }
    if (kind != SDM_EDGES) return all;
    // (f1 + f2) / 2 <= 0 rejects concave edges; row 3 of an edge's extent is for this mean
    const v8f mean = v8_sub(v8_mul(v8_add(x->f[1], x->f[2]), v8_all(0.5f)), v8_all(most[1]));
    return v8_max(all, v8_fma(minus_half, v8_all(function_value(kind, extent, 3, lane)), mean));
}

/* Squared distances of eight points from the plane of a face, the line of an edge or a corner, from
   the functions of the feature at the points, and for a corner the vectors from it to the points.
 */
SDM_FOR_KIND v8f function_distance2(int kind, const functions8 *x, point8 from)
{
    if (kind == SDM_CORNERS) return p8_dot(from, from);
    const v8f d2 = v8_mul(x->f[3], x->f[3]);
    return kind == SDM_EDGES ? v8_fma(x->f[1], x->f[1], d2) : d2;
}
