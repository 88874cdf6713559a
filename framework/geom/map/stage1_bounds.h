/* Stage 1: bounds on the distance. For eight parts at once, finds a point of the surface near each
   part (its reference point) and derives the largest distance at which a cluster may hold the
   nearest feature. Part of map.inc. */
#pragma once

#include "grid_scratch.h"
#include "reference.h"

/* c + the largest change of a linear function with gradient g from the centre of a part to its
   corners. */
static inline v8f extent_plus(const sdm_grid_parts *q, bool aligned, point8 g, v8f c)
{
    if (aligned)
        return v8_fma(
            v8_abs(g.x), v8_all(q->half[0]),
            v8_fma(v8_abs(g.y), v8_all(q->half[1]), v8_fma(v8_abs(g.z), v8_all(q->half[2]), c)));
    for (int a = 0; a < 3; a++) {
        const float *h = q->half_axis[a];
        c = v8_add(c, v8_abs(p8_dot(g, p8_all(h[0], h[1], h[2]))));
    }
    return c;
}

/* Culling data of eight parts. The reference point of a part is a point of the surface at distance
   D from the part's centre; g is the unit vector from it to the centre. A convex set at distance d
   from the centre, with unit vector h from its nearest point to the centre, is farther than the
   reference point at every point x of the part (x relative to the centre, |x| <= r) if
       d > max over x of (distance of the reference point - h . x),
   since convexity gives: distance of the set at x >= d + h . x. Two upper bounds on the distance of
   the reference point at x are used: its distance from the farthest corner, and
   D + g . x + |x|^2 / (2 D). All members include margins for rounding. */
typedef struct cull8 {
    /* centres of the parts, and directions g */
    point8 centre, g;
    /* distance of the reference point from the farthest corner; cull_limit() adds the extent of
       h */
    v8f corner;
    /* D + r^2 / (2 D); cull_limit() adds the extent of h - g */
    v8f curved;
    /* width of the narrow band + r: farther sets are outside the band for every point of the
       part */
    v8f band;
} cull8;

/* Computes the culling data of eight parts. centre, reference: the centres of the parts and their
   reference points. q: the level of the parts. */
static inline cull8 cull_start(const sdm_grid_job *job, const sdm_grid_parts *q, point8 centre,
                               const sdm_points *reference)
{
    point8 g;
    const v8f d = length8(p8_sub(centre, p8_load(reference->x)), &g);
    const v8f r = v8_all(q->radius);
    // distance of the farthest corner from the reference point <= d + min(r, exact difference)
    v8f more = r;
    if (job->aligned) {
        const point8 w = {v8_fma(v8_abs(g.x), d, v8_all(q->half[0])),
                          v8_fma(v8_abs(g.y), d, v8_all(q->half[1])),
                          v8_fma(v8_abs(g.z), d, v8_all(q->half[2]))};
        more = v8_min(more, v8_fma(d, v8_all(SDM_CULL), v8_sub(v8_sqrt(p8_dot(w, w)), d)));
    }
    // base: d plus all margins for rounding
    const v8f base = v8_fma(v8_add(d, r), v8_all(SDM_CULL), v8_add(d, v8_all(4 * job->error)));
    const v8f curvature = v8_div(v8_mul(r, r), v8_add(v8_add(d, d), v8_all(SDM_TINY)));
    return (cull8){.centre = centre,
                   .g = g,
                   .corner = v8_add(base, v8_max(more, v8_all(0))),
                   .curved = v8_add(base, curvature),
                   .band = v8_all((job->band + q->radius) * (1 + SDM_CULL) + 4 * job->error)};
}

/* For each part, the largest distance from its centre at which a convex set may hold the surface
   point nearest to some point of the part. h: unit vector from the set's nearest point to the
   centre. */
static inline v8f cull_limit(const sdm_grid_parts *q, bool aligned, const cull8 *v, point8 h)
{
    return v8_min(v8_min(v->band, extent_plus(q, aligned, h, v->corner)),
                  extent_plus(q, aligned, p8_sub(h, v->g), v->curved));
}

/* Finds reference points for the eight tiles of a block, whose centres are p: each given point is
   replaced by the nearest triangle centroid of the block's clusters, if this is nearer to the
   centre. */
static void references_of_tiles(const sdm_features *f, const sdm_cluster_list *clusters, point8 p,
                                sdm_points *reference)
{
    centroid8 best = centroids_start(p, reference);
    for (size_t i = 0; i < clusters->n; i++) {
        const sdm_cluster_node *node = &f->node[clusters->list[i]];
        const point8 b = vector_from_box(node, p);
        if (v8_greater(p8_dot(b, b), best.d2) != 0xff) centroids_compare(f, node, p, &best);
    }
    centroids_finish(f, &best, reference);
}
