/* Reference points: points of the surface near eight given points, one in each SIMD lane, which
   bound the distances of these points from above. Terms are defined in map.inc. */
#pragma once

#include "features/surface_features.h"
#include "grid_job.h"
#include "simd/lanes.h"

#define SDM_CULL 1e-3f  // relative margin: more than two errors of v8_rsqrt()
#define SDM_TINY 1e-30f // keeps divisors positive

/* Returns the length of w and sets its direction (shorter than a unit vector where w is nearly 0),
   both with a relative error below SDM_CULL / 2. */
static inline v8f length8(point8 w, point8 *unit)
{
    const v8f d2 = v8_add(p8_dot(w, w), v8_all(SDM_TINY)), inverse = v8_rsqrt(d2);
    *unit = p8_scale(w, inverse);
    return v8_mul(d2, inverse);
}

/* Vectors from the nearest points of eight boxes with the corners lo and hi to eight points. */
static inline point8 vector_from_boxes(point8 lo, point8 hi, point8 p)
{
    const point8 nearest = {v8_min(v8_max(p.x, lo.x), hi.x), v8_min(v8_max(p.y, lo.y), hi.y),
                            v8_min(v8_max(p.z, lo.z), hi.z)};
    return p8_sub(p, nearest);
}

/* The same for the box of one node. */
static inline point8 vector_from_box(const sdm_cluster_node *node, point8 p)
{
    return vector_from_boxes(p8_all(node->lo[0], node->lo[1], node->lo[2]),
                             p8_all(node->hi[0], node->hi[1], node->hi[2]), p);
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

/* Finds reference points for eight parts by a walk of the tree: the triangle centroids of the whole
   surface that are nearest to the centres p of the parts. reference: on input eight points of the
   surface; each is replaced if the centroid is nearer. The order of the walk suits parts of which
   the first and the last lie opposite to each other. */
static inline void references_of_parts(const sdm_features *f, point8 p, sdm_points *reference)
{
    sdm_points at;
    p8_store(at.x, p);
    // twice the centre of the whole
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
        // visit first the child whose centre is nearer to the centre of the whole
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
