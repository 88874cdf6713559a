/* Bounds on distances over the parts of a box. Part of the map kernels (grid_kernel.inc). */
#ifndef SDM_GEOM_BOUNDS_KERNEL_H
#define SDM_GEOM_BOUNDS_KERNEL_H

#include "grid_job.h"
#include "simd/lanes.h"

#define SDM_CULL 1e-3f // more than two errors of v8_rsqrt(), relative
#define SDM_TINY 1e-30f

/* c, and the largest change of a linear function with gradient g from the middle of a part to its
 * corners. */
static inline v8f extent_and(const sdm_grid_parts *q, bool aligned, point8 g, v8f c)
{
    if (aligned)
        return v8_fma(
            v8_abs(g.x), v8_all(q->half[0]),
            v8_fma(v8_abs(g.y), v8_all(q->half[1]), v8_fma(v8_abs(g.z), v8_all(q->half[2]), c)));
    for (int a = 0; a < 3; a++)
        c = v8_add(c, v8_abs(p8_dot(g, p8_all(q->axis[a][0], q->axis[a][1], q->axis[a][2]))));
    return c;
}

static inline v8f extent(const sdm_grid_parts *q, bool aligned, point8 g)
{
    return extent_and(q, aligned, g, v8_all(0));
}

/* Length of w and its direction (shorter than a unit vector where w is nearly 0), each good to half
 * of SDM_CULL. */
static inline v8f length8(point8 w, point8 *unit)
{
    const v8f d2 = v8_add(p8_dot(w, w), v8_all(SDM_TINY)), inverse = v8_rsqrt(d2);
    *unit = p8_scale(w, inverse);
    return v8_mul(d2, inverse);
}

/* What is known about eight parts: their middles p, a point of the surface near each in direction
   -g (unit vectors), and how far something convex must be from the middle of a part, in direction
   h, to be farther than that point everywhere in it: at x from the middle its distance is at least
   d + h . x, that of the point at most d' + g . x + |x|^2 / (2 d'), and at most as much as at the
   farthest corner. */
typedef struct view8 {
    point8 p, g;
    v8f corner; /* distance of the point at the farthest corner, rounding included; + extent(h) */
    v8f bend;   /* d' + r^2 / (2 d'), the same; + extent(h - g) */
    v8f band;   /* for every h */
} view8;

/* at: the points of the surface. */
static inline view8 view_of(const sdm_grid_job *job, const sdm_grid_parts *q, point8 p,
                            const float at[3][8])
{
    point8 g;
    const v8f d = length8(p8_sub(p, p8_load(at)), &g);
    const v8f r = v8_all(q->radius);
    // a corner is at most that much farther from the point than the middle
    v8f most = r;
    if (job->aligned) {
        const point8 w = {v8_fma(v8_abs(g.x), d, v8_all(q->half[0])),
                          v8_fma(v8_abs(g.y), d, v8_all(q->half[1])),
                          v8_fma(v8_abs(g.z), d, v8_all(q->half[2]))};
        most = v8_min(most, v8_fma(d, v8_all(SDM_CULL), v8_sub(v8_sqrt(p8_dot(w, w)), d)));
    }
    const v8f base = v8_fma(v8_add(d, r), v8_all(SDM_CULL), v8_add(d, v8_all(4 * job->error)));
    return (view8){.p = p,
                   .g = g,
                   .corner = v8_add(base, v8_max(most, v8_all(0))),
                   .bend =
                       v8_add(base, v8_div(v8_mul(r, r), v8_add(v8_add(d, d), v8_all(SDM_TINY)))),
                   .band = v8_all((job->band + q->radius) * (1 + SDM_CULL) + 4 * job->error)};
}

static inline v8f limit8(const sdm_grid_parts *q, bool aligned, const view8 *v, point8 h)
{
    return v8_min(v8_min(v->band, extent_and(q, aligned, h, v->corner)),
                  extent_and(q, aligned, p8_sub(h, v->g), v->bend));
}

#endif
