/* One feature and eight points: region and distance. Part of the map kernels. */
#ifndef SDM_GEOM_FEATURES_KERNEL_H
#define SDM_GEOM_FEATURES_KERNEL_H

#include "bounds_kernel.h"

/* Function k of a row, with another offset. */
static inline v8f function8(const sdm_feature_row *r, int k, float offset, point8 p)
{
    return p8_linear(p8_all(r->g[0][k], r->g[1][k], r->g[2][k]), p, v8_all(offset));
}

/* The middle of an edge, the place of a corner. */
static inline point8 point_of(const sdm_feature_row *r) { return p8_all(r->g[0][3], r->g[1][3], r->g[2][3]); }

/* A row in registers. */
typedef struct row4 {
    v4f g[3], offset;
} row4;

static inline row4 load_row(const sdm_feature_row *r)
{
    return (row4){{f4_load(r->g[0]), f4_load(r->g[1]), f4_load(r->g[2])}, f4_load(r->offset)};
}

static inline void store_row(sdm_feature_row *r, row4 x)
{
    for (int a = 0; a < 3; a++) f4_store(r->g[a], x.g[a]);
    f4_store(r->offset, x.offset);
}

/* The same as of an origin moved by `shift`. */
static inline row4 shift_face(row4 r, const float shift[3])
{
    for (int a = 0; a < 3; a++) r.offset = f4_fma(r.g[a], f4_all(shift[a]), r.offset);
    return r;
}

static inline row4 shift_edge(row4 r, const float shift[3])
{
    // the last column is a point and a length
    const v4i last = {0, 0, 0, -1};
    const v4f length = (v4f)((v4i)r.offset & last);
    r = shift_face(r, shift);
    for (int a = 0; a < 3; a++) r.g[a] -= (v4f)((v4i)f4_all(shift[a]) & last);
    r.offset = (v4f)(((v4i)r.offset & ~last) | (v4i)length);
    return r;
}

/* How much the functions of a row may change from the middle of a part to its corners, rounding included. */
static inline v4f reach_of(const sdm_grid_parts *q, bool aligned, const row4 *r, float error)
{
    v4f sum = f4_all(error);
    if (aligned)
        return f4_fma(f4_abs(r->g[0]), f4_all(q->half[0]),
                      f4_fma(f4_abs(r->g[1]), f4_all(q->half[1]), f4_fma(f4_abs(r->g[2]), f4_all(q->half[2]), sum)));
    for (int a = 0; a < 3; a++)
        sum += f4_abs(f4_fma(r->g[0], f4_all(q->axis[a][0]),
                             f4_fma(r->g[1], f4_all(q->axis[a][1]), r->g[2] * f4_all(q->axis[a][2]))));
    return sum;
}

typedef struct float4 {
    _Alignas(16) float of[4];
} float4;

/* Offsets less what the functions may change: where one of them is greater than 0, the part at p does not meet the region. */
static inline float4 lowered(const row4 *r, v4f reach)
{
    float4 low;
    f4_store(low.of, r->offset - reach);
    return low;
}

static inline v8f beyond_face(const sdm_feature_row *r, const float4 *low, point8 p)
{
    return v8_max(function8(r, 0, low->of[0], p),
                  v8_max(function8(r, 1, low->of[1], p), function8(r, 2, low->of[2], p)));
}

static inline v8f beyond_thin_face(const sdm_feature_row *r, const float4 *low, point8 p)
{
    return v8_max(beyond_face(r, low, p), function8(r, 3, low->of[3], p));
}

/* along: function 0, which may go up to `end` from the middle. */
static inline v8f beyond_edge(const sdm_feature_row *r, const float4 *low, v8f along, float end, point8 p)
{
    return v8_max(v8_abs(along) - v8_all(end), v8_max(function8(r, 1, low->of[1], p), function8(r, 2, low->of[2], p)));
}

/* x: from the corner to eight points. */
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
