/* Stage 2: culling of clusters by distance, first for the blocks of a box, then for the tiles of a
   block. Part of map.inc. */
#pragma once

#include "lists.h"
#include "stage1_bounds.h"

/* Mask of the parts that contain a point whose nearest feature may lie below the node. */
static inline int node_parts(const sdm_grid_parts *q, bool narrow, bool aligned, const cull8 *v,
                             const sdm_cluster_node *node)
{
    if (narrow) {
        const point8 w = vector_from_box(node, v->centre);
        return 0xff & ~v8_greater(p8_dot(w, w), v8_mul(v->band, v->band));
    }
    point8 h;
    const v8f d = length8(vector_from_box(node, v->centre), &h);
    return 0xff & ~v8_greater(d, cull_limit(q, aligned, v, h));
}

/* Walks the tree and lists in scratch->block[], for each block of a box, the clusters that may hold
   the nearest feature of a point of the block. blocks: mask of the blocks inside the grid. */
static sdm_status clusters_of_blocks(const sdm_grid_job *job, const cull8 *v, int blocks,
                                     sdm_grid_scratch *scratch, sdm_error *err)
{
    const sdm_features *f = job->features;
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    size_t n = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t i = stack[--top];
        const sdm_cluster_node *node = &f->node[i];
        const int mask =
            blocks & node_parts(&job->part[SDM_BLOCKS], job->narrow, job->aligned, v, node);
        if (!mask) continue;
        if (!node->count) {
            stack[top++] = node->first + 1;
            stack[top++] = node->first;
            continue;
        }
        // a cluster: keep it
        if (n >= scratch->cluster_cap) {
            const sdm_status s = sdm_grid_scratch_clusters(scratch, 2 * n + 256, err);
            if (s) return s;
        }
        scratch->node[n] = i;
        scratch->node_blocks[n++] = (uint8_t)mask;
    }
    clusters_distribute(job, scratch->node_blocks, scratch->node, n, scratch->block);
    return SDM_OK;
}

/* Lists in scratch->cluster[] the clusters that may hold the nearest feature of a point of the
   block's tiles. centre_mm: centre of the block. tiles: mask of the tiles inside the grid. Returns
   an upper bound on the distance between a point of the block and a point of these clusters,
   scaled. */
static float clusters_of_tiles(const sdm_grid_job *job, const sdm_cluster_list *in,
                               const double centre_mm[3], const cull8 *v, int tiles,
                               sdm_grid_scratch *scratch)
{
    const sdm_features *f = job->features;
    float farthest = 0;
    double centre[3];
    size_t n = 0;
    for (int a = 0; a < 3; a++) centre[a] = (centre_mm[a] - f->centre[a]) * f->scale;
    // cull, without branches: the masks are unpredictable
    for (size_t i = 0; i < in->n; i++) {
        const int mask = tiles & node_parts(&job->part[SDM_TILES], job->narrow, job->aligned, v,
                                            &f->node[in->list[i]]);
        scratch->cluster[n] = (sdm_cluster_ref){.node = in->list[i], .tiles = (uint32_t)mask};
        n += mask != 0;
    }
    scratch->n_cluster = n;
    // vectors between centres, and the farthest corner of the clusters' boxes
    for (size_t i = 0; i < n; i++) {
        sdm_cluster_ref *c = &scratch->cluster[i];
        const sdm_cluster_node *node = &f->node[c->node];
        float sum = 0;
        for (int a = 0; a < 3; a++) {
            c->shift[a] = (float)(centre[a] - (double)sdm_cluster_centre(node, a));
            const float far = fabsf(c->shift[a]) + (node->hi[a] - node->lo[a]) / 2;
            sum += far * far;
        }
        farthest = sum > farthest ? sum : farthest;
    }
    return sqrtf(farthest) + job->part[SDM_BLOCKS].radius;
}
