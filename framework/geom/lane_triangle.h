/* Distances from a triangle to eight points in float and to four in double, for the block kernels. */
#ifndef SDM_GEOM_LANE_TRIANGLE_H
#define SDM_GEOM_LANE_TRIANGLE_H

#include <stdbool.h>

#include "grid_job.h"
#include "lanes.h"

static inline bool all_greater(v8f a, v8f b) { return v8_greater(a, b) == 0xff; }

/* Linear functions of a triangle at 8 points; half lengths of its edges. */
typedef struct functions {
    v8f t0, h0, t1, h1, t2, h2, z, half0, half1, half2;
} functions;

static inline v8f function_at(const sdm_candidate *k, int i, v8f x, v8f y, v8f z)
{
    return v8_fma(v8_all(k->g[0][i]), x,
                  v8_fma(v8_all(k->g[1][i]), y, v8_fma(v8_all(k->g[2][i]), z, v8_all(k->g[3][i]))));
}

static inline functions functions_at(const sdm_candidate *k, const sdm_points *point)
{
    const v8f x = v8_load(point->x[0]), y = v8_load(point->x[1]), z = v8_load(point->x[2]);
    return (functions){.t0 = function_at(k, 0, x, y, z),
                       .h0 = function_at(k, 1, x, y, z),
                       .t1 = function_at(k, 2, x, y, z),
                       .h1 = function_at(k, 3, x, y, z),
                       .t2 = function_at(k, 4, x, y, z),
                       .h2 = function_at(k, 5, x, y, z),
                       .z = function_at(k, 6, x, y, z),
                       .half0 = v8_all(k->g[0][7]),
                       .half1 = v8_all(k->g[1][7]),
                       .half2 = v8_all(k->g[2][7])};
}

/* How the functions change when the points move by shift. */
static inline void shift_functions(const sdm_candidate *k, const float shift[3], float change[8])
{
    v8_store(change, v8_fma(v8_load(k->g[0]), v8_all(shift[0]),
                            v8_fma(v8_load(k->g[1]), v8_all(shift[1]), v8_load(k->g[2]) * v8_all(shift[2]))));
}

static inline v8f squared_distance(const functions *r)
{
    const v8f zero = v8_all(0);
    const v8f b0 = v8_max(v8_abs(r->t0) - r->half0, zero);
    const v8f b1 = v8_max(v8_abs(r->t1) - r->half1, zero);
    const v8f b2 = v8_max(v8_abs(r->t2) - r->half2, zero);
    const v8f inside = b0 * b0;
    const v8f edge =
        v8_min(v8_fma(r->h0, r->h0, inside), v8_min(v8_fma(r->h1, r->h1, b1 * b1), v8_fma(r->h2, r->h2, b2 * b2)));
    const v8f outward = v8_max(r->h0, v8_max(r->h1, r->h2));
    return v8_fma(r->z, r->z, v8_signed(outward, inside, edge));
}

static inline functions shifted(const functions *r, const float change[8])
{
    return (functions){.t0 = r->t0 + v8_all(change[0]),
                       .h0 = r->h0 + v8_all(change[1]),
                       .t1 = r->t1 + v8_all(change[2]),
                       .h1 = r->h1 + v8_all(change[3]),
                       .t2 = r->t2 + v8_all(change[4]),
                       .h2 = r->h2 + v8_all(change[5]),
                       .z = r->z + v8_all(change[6]),
                       .half0 = r->half0,
                       .half1 = r->half1,
                       .half2 = r->half2};
}

/* sdm_frame_distance2() at four points, the same operations in the same order. */
static inline v4d exact_distance2(const sdm_frame *f, v4d px, v4d py, v4d pz)
{
    const v4d wx = px - v4_all(f->a[0]), wy = py - v4_all(f->a[1]), wz = pz - v4_all(f->a[2]), zero = v4_all(0);
    const v4d x = wx * v4_all(f->u[0]) + wy * v4_all(f->u[1]) + wz * v4_all(f->u[2]);
    const v4d y = wx * v4_all(f->v[0]) + wy * v4_all(f->v[1]) + wz * v4_all(f->v[2]);
    const v4d z = wx * v4_all(f->n[0]) + wy * v4_all(f->n[1]) + wz * v4_all(f->n[2]);
    const v4d e1x = v4_all(f->e1x), e1y = v4_all(f->e1y), e2x = v4_all(f->e2x), e2y = v4_all(f->e2y);
    const v4d t0 = x - v4_all(f->half[0]), t1 = e1x * x + e1y * y - v4_all(f->kt1),
              t2 = e2x * x + e2y * y - v4_all(f->kt2);
    const v4d h0 = -y, h1 = e1y * x - e1x * y - v4_all(f->kh1), h2 = e2y * x - e2x * y;
    const v4d b0 = v4_max(v4_abs(t0) - v4_all(f->half[0]), zero);
    const v4d b1 = v4_max(v4_abs(t1) - v4_all(f->half[1]), zero);
    const v4d b2 = v4_max(v4_abs(t2) - v4_all(f->half[2]), zero);
    const v4d inside = b0 * b0;
    const v4d edge = v4_min(inside + h0 * h0, v4_min(b1 * b1 + h1 * h1, b2 * b2 + h2 * h2));
    return v4_signed(v4_max(h0, v4_max(h1, h2)), inside, edge) + z * z;
}

#endif
