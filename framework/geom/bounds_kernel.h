/* Bounds on distances over the parts of a box. Part of the map kernels (grid_kernel.inc). */
#ifndef SDM_GEOM_BOUNDS_KERNEL_H
#define SDM_GEOM_BOUNDS_KERNEL_H

#include "grid_job.h"
#include "lanes.h"

#define SDM_CULL 1e-3f // more than two errors of v8_rsqrt(), relative
#define SDM_TINY 1e-30f

/* Largest change of a linear function with gradient g from the middle of a part to its corners. */
static inline v8f extent(const sdm_grid_parts *q, bool aligned, point8 g)
{
    if (aligned)
        return v8_fma(v8_abs(g.x), v8_all(q->half[0]),
                      v8_fma(v8_abs(g.y), v8_all(q->half[1]), v8_abs(g.z) * v8_all(q->half[2])));
    v8f sum = v8_all(0);
    for (int a = 0; a < 3; a++) sum += v8_abs(p8_dot(g, p8_all(q->axis[a][0], q->axis[a][1], q->axis[a][2])));
    return sum;
}

/* Length of w and its direction (shorter than a unit vector where w is nearly 0), each good to half of SDM_CULL. */
static inline v8f length8(point8 w, point8 *unit)
{
    const v8f d2 = p8_dot(w, w) + v8_all(SDM_TINY), inverse = v8_rsqrt(d2);
    *unit = p8_scale(w, inverse);
    return d2 * inverse;
}

/* A point of the surface near the middle of each part: its distance d, the unit vector g from it to the middle, and what limit8() is
   made of. */
typedef struct reference8 {
    _Alignas(32) float d[8], g[3][8], base[8], bend[8], most[8];
    float band;
} reference8;

static inline void set_limits(const sdm_grid_job *job, const sdm_grid_parts *q, reference8 *n)
{
    const v8f d = v8_load(n->d), r = v8_all(q->radius);
    v8_store(n->base, d + v8_all(4 * job->error) + (d + r) * v8_all(SDM_CULL));
    v8_store(n->bend, r * r / (d + d + v8_all(SDM_TINY)));
    // a corner is at most that much farther from the reference than the middle
    v8f most = r;
    if (job->aligned) {
        const point8 g = p8_load((const float(*)[8])n->g);
        const point8 w = {v8_fma(v8_abs(g.x), d, v8_all(q->half[0])), v8_fma(v8_abs(g.y), d, v8_all(q->half[1])),
                          v8_fma(v8_abs(g.z), d, v8_all(q->half[2]))};
        most = v8_min(most, v8_sqrt(p8_dot(w, w)) - d + d * v8_all(SDM_CULL));
    }
    v8_store(n->most, v8_max(most, v8_all(0)));
    n->band = (job->band + q->radius) * (1 + SDM_CULL) + 4 * job->error;
}

/* p: the middles; at: the points of the surface. */
static inline void set_reference(const sdm_grid_job *job, const sdm_grid_parts *q, point8 p, const float at[3][8],
                                 reference8 *n)
{
    point8 g;
    v8_store(n->d, length8(p8_sub(p, p8_load(at)), &g));
    p8_store(n->g, g);
    set_limits(job, q, n);
}

/* The same for one part after the other, or for eight parts at once. */
typedef struct view8 {
    point8 p, g;
    v8f base, bend, most, band;
} view8;

static inline view8 view_all(const reference8 *n, point8 p)
{
    return (view8){p, p8_load(n->g), v8_load(n->base), v8_load(n->bend), v8_load(n->most), v8_all(n->band)};
}

static inline view8 view_one(const reference8 *n, const sdm_points *middle, int i)
{
    return (view8){p8_all(middle->x[0][i], middle->x[1][i], middle->x[2][i]),
                   p8_all(n->g[0][i], n->g[1][i], n->g[2][i]),
                   v8_all(n->base[i]),
                   v8_all(n->bend[i]),
                   v8_all(n->most[i]),
                   v8_all(n->band)};
}

/* How far something convex must be from the middle of a part, in direction g, to be farther than the reference everywhere in it: at x
   from the middle its distance is at least d + g . x, that of the reference at most d' + g' . x + |x|^2 / (2 d'). */
static inline v8f limit8(const sdm_grid_parts *q, bool aligned, const view8 *v, point8 g)
{
    return v8_min(v->band,
                  v->base + v8_min(v->most + extent(q, aligned, g), extent(q, aligned, p8_sub(g, v->g)) + v->bend));
}

#endif
