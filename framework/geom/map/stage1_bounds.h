/* Stage 1: bounds on the distance. For eight parts at once, finds a point of the surface near each
   part (its reference point) and derives the largest distance at which a cluster may hold the
   nearest feature. Part of map.inc. */
#pragma once

#include "grid_scratch.h"
#include "simd/lanes.h"

#define SDM_CULL 1e-3f  // relative margin: more than two errors of v8_rsqrt()
#define SDM_TINY 1e-30f // keeps divisors positive

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

/* Returns the length of w and sets its direction (shorter than a unit vector where w is nearly 0),
   both with a relative error below SDM_CULL / 2. */
static inline v8f length8(point8 w, point8 *unit)
{
    const v8f d2 = v8_add(p8_dot(w, w), v8_all(SDM_TINY)), inverse = v8_rsqrt(d2);
    *unit = p8_scale(w, inverse);
    return v8_mul(d2, inverse);
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

/* Vectors from the nearest points of a node's box to eight points. */
static inline point8 vector_from_box(const sdm_cluster_node *node, point8 p)
{
    const point8 lo = p8_all(node->lo[0], node->lo[1], node->lo[2]),
                 hi = p8_all(node->hi[0], node->hi[1], node->hi[2]);
    const point8 nearest = {v8_min(v8_max(p.x, lo.x), hi.x), v8_min(v8_max(p.y, lo.y), hi.y),
                            v8_min(v8_max(p.z, lo.z), hi.z)};
    return p8_sub(p, nearest);
}

/* For each of eight points the nearest triangle centroid so far: its squared distance, and the slot
   of the triangle (-1: none is nearer than the given reference point). Centroids serve as reference
   points. */
typedef struct centroid8 {
    v8f d2;
    v8i slot;
} centroid8;

static inline centroid8 centroids_start(point8 p, const sdm_points *reference)
{
    const point8 w = p8_sub(p, p8_load(reference->x));
    return (centroid8){p8_dot(w, w), v8_all_i(-1)};
}

/* Compares the eight points with the centroids of a cluster's triangles. */
static inline void centroids_compare(const sdm_features *f, const sdm_cluster_node *cluster,
                                     point8 p, centroid8 *best)
{
    for (uint32_t i = cluster->first; i < cluster->first + cluster->count; i++) {
        const float *c = f->centroid[i];
        const point8 w = p8_sub(p, p8_all(c[0], c[1], c[2]));
        const v8f d2 = p8_dot(w, w);
        best->slot = v8_if_less(d2, best->d2, v8_all_i((int32_t)i), best->slot);
        best->d2 = v8_min(d2, best->d2);
    }
}

/* Replaces the reference points for which a nearer centroid was found. */
static inline void centroids_finish(const sdm_features *f, const centroid8 *best,
                                    sdm_points *reference)
{
    uint32_t slot[8];
    v8_store_i(slot, best->slot);
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3 && slot[i] != SDM_NONE; a++)
            reference->x[a][i] = f->centroid[slot[i]][a];
}

/* Finds reference points for the eight blocks of a box by a walk of the tree: the triangle
   centroids of the whole surface that are nearest to the centres p of the blocks. reference: on
   input eight points of the surface; each is replaced if the centroid is nearer. */
static void references_of_blocks(const sdm_features *f, point8 p, sdm_points *reference)
{
    sdm_points at;
    p8_store(at.x, p);
    // parts 0 and 7 lie opposite to each other: their centres add up to twice the centre of the box
    float twice_centre[3];
    for (int a = 0; a < 3; a++) twice_centre[a] = at.x[a][0] + at.x[a][7];
    centroid8 best = centroids_start(p, reference);
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    stack[top++] = 0;
    while (top) {
        const sdm_cluster_node *node = &f->node[stack[--top]];
        const point8 b = vector_from_box(node, p);
        if (v8_greater(p8_dot(b, b), best.d2) == 0xff) continue;
        if (node->count) {
            centroids_compare(f, node, p, &best);
            continue;
        }
        // visit first the child whose centre is nearer to the centre of the box
        const sdm_cluster_node *child = &f->node[node->first];
        float d[2] = {0, 0};
        for (int c = 0; c < 2; c++)
            for (int a = 0; a < 3; a++)
                d[c] += fabsf(child[c].lo[a] + child[c].hi[a] - twice_centre[a]);
        const uint32_t near = d[1] < d[0];
        stack[top++] = node->first + !near;
        stack[top++] = node->first + near;
    }
    centroids_finish(f, &best, reference);
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
