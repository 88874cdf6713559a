/* From the tree of clusters to the clusters of a box and of a block. Part of the map kernels. */
#ifndef SDM_GEOM_CLUSTERS_KERNEL_H
#define SDM_GEOM_CLUSTERS_KERNEL_H

#include "lists.h"
#include "stage1_bounds.h"

/* From the box of a node to eight points. */
static inline point8 from_box(const sdm_cluster_node *node, point8 p)
{
    const point8 lo = p8_all(node->lo[0], node->lo[1], node->lo[2]),
                 hi = p8_all(node->hi[0], node->hi[1], node->hi[2]);
    const point8 nearest = {v8_min(v8_max(p.x, lo.x), hi.x), v8_min(v8_max(p.y, lo.y), hi.y),
                            v8_min(v8_max(p.z, lo.z), hi.z)};
    return p8_sub(p, nearest);
}

/* Parts in which a node may hold the nearest feature. */
static inline int concerned(const sdm_grid_parts *q, bool aligned, const view8 *v,
                            const sdm_cluster_node *node)
{
    point8 g;
    const v8f d = length8(from_box(node, v->p), &g);
    return 0xff & ~v8_greater(d, limit8(q, aligned, v, g));
}

/* Centroids near eight points: squared distance, number of the face, -1 for none. */
typedef struct centroid8 {
    v8f d2;
    v8i face;
} centroid8;

static inline void offer_centroids(const sdm_features *f, const sdm_cluster_node *cluster, point8 p,
                                   centroid8 *best)
{
    for (uint32_t i = cluster->first; i < cluster->first + cluster->count; i++) {
        const float *c = f->centroid[i];
        const point8 w = p8_sub(p, p8_all(c[0], c[1], c[2]));
        const v8f d2 = p8_dot(w, w);
        best->face = v8_if_less(d2, best->d2, v8_all_i((int32_t)i), best->face);
        best->d2 = v8_min(d2, best->d2);
    }
}

static inline void take_centroids(const sdm_features *f, const centroid8 *best, float at[3][8])
{
    uint32_t face[8];
    v8_store_i(face, best->face);
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3 && face[i] != SDM_NONE; a++) at[a][i] = f->centroid[face[i]][a];
}

/* Puts the centroids nearest to the points p in the place of at[3][8], where they are nearer. */
static void find_centroids(const sdm_features *f, point8 p, float at[3][8])
{
    const point8 w = p8_sub(p, p8_load((const float(*)[8])at));
    _Alignas(32) float x[3][8];
    p8_store(x, p);
    const float middle[3] = {x[0][0] + x[0][7], x[1][0] + x[1][7], x[2][0] + x[2][7]};
    centroid8 best = {p8_dot(w, w), v8_all_i(-1)};
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    stack[top++] = 0;
    while (top) {
        const sdm_cluster_node *node = &f->node[stack[--top]];
        const point8 b = from_box(node, p);
        if (v8_greater(p8_dot(b, b), best.d2) == 0xff) continue;
        if (node->count) {
            offer_centroids(f, node, p, &best);
            continue;
        }
        const sdm_cluster_node *child = &f->node[node->first];
        float d[2] = {0, 0};
        for (int c = 0; c < 2; c++)
            for (int a = 0; a < 3; a++) d[c] += fabsf(child[c].lo[a] + child[c].hi[a] - middle[a]);
        const uint32_t near = d[1] < d[0];
        stack[top++] = node->first + !near;
        stack[top++] = node->first + near;
    }
    take_centroids(f, &best, at);
}

/* Clusters of the tree that concern blocks of a box. */
static sdm_status clusters_of_box(const sdm_grid_job *job, const view8 *v, int wanted,
                                  sdm_grid_scratch *s, sdm_error *err)
{
    const sdm_features *f = job->features;
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    size_t n = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t i = stack[--top];
        const sdm_cluster_node *node = &f->node[i];
        const int mask = wanted & concerned(&job->part[SDM_TO_BLOCKS], job->aligned, v, node);
        if (!mask) continue;
        if (!node->count) {
            stack[top++] = node->first + 1;
            stack[top++] = node->first;
            continue;
        }
        if (n >= s->cluster_cap) {
            const sdm_status st = sdm_grid_scratch_box(s, 2 * n + 256, err);
            if (st) return st;
        }
        s->node[n] = i;
        s->node_hit[n++] = (uint8_t)mask;
    }
    list_hits(job, s->node_hit, s->node, n, s->block);
    return SDM_OK;
}

/* Puts centroids near the middles p of the tiles of a block in the place of at[3][8], where they
 * are nearer. */
static void refer_tiles(const sdm_features *f, const sdm_cluster_list *in, point8 p, float at[3][8])
{
    const point8 w = p8_sub(p, p8_load((const float(*)[8])at));
    centroid8 best = {p8_dot(w, w), v8_all_i(-1)};
    for (size_t i = 0; i < in->n; i++) {
        const sdm_cluster_node *node = &f->node[in->list[i]];
        const point8 b = from_box(node, p);
        if (v8_greater(p8_dot(b, b), best.d2) != 0xff) offer_centroids(f, node, p, &best);
    }
    take_centroids(f, &best, at);
}

/* Clusters of a block that concern its tiles. middle: of the block, mm. Returns a bound on the
   distance of their points from those of the block. */
static float clusters_of_block(const sdm_grid_job *job, const sdm_cluster_list *in,
                               const double middle[3], const view8 *v, int wanted,
                               sdm_grid_scratch *s)
{
    const sdm_features *f = job->features;
    float farthest = 0;
    double at[3];
    size_t n = 0;
    for (int a = 0; a < 3; a++) at[a] = (middle[a] - f->centre[a]) * f->scale;
    for (size_t i = 0; i < in->n; i++) {
        const int mask =
            wanted & concerned(&job->part[SDM_TO_TILES], job->aligned, v, &f->node[in->list[i]]);
        s->cluster[n] = (sdm_cluster_ref){.node = in->list[i], .mask = (uint32_t)mask};
        n += mask != 0;
    }
    s->n_cluster = n;
    for (size_t i = 0; i < n; i++) {
        sdm_cluster_ref *c = &s->cluster[i];
        const sdm_cluster_node *node = &f->node[c->node];
        float sum = 0;
        for (int a = 0; a < 3; a++) {
            c->shift[a] = (float)(at[a] - (double)sdm_cluster_middle(node, a));
            const float far = fabsf(c->shift[a]) + (node->hi[a] - node->lo[a]) / 2;
            sum += far * far;
        }
        farthest = sum > farthest ? sum : farthest;
    }
    return sqrtf(farthest) + job->part[SDM_TO_BLOCKS].radius;
}

#endif
