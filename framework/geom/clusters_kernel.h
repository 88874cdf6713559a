/* From the tree of clusters to the clusters of a box, of a block, and to the features of its tiles. Part of the map kernels. */
#ifndef SDM_GEOM_CLUSTERS_KERNEL_H
#define SDM_GEOM_CLUSTERS_KERNEL_H

#include "bounds_kernel.h"

/* From the box of a node to eight points. */
static inline point8 from_box(const sdm_cluster_node *node, point8 p)
{
    const v8f zero = v8_all(0);
    return (point8){v8_max(p.x - v8_all(node->hi[0]), zero) - v8_max(v8_all(node->lo[0]) - p.x, zero),
                    v8_max(p.y - v8_all(node->hi[1]), zero) - v8_max(v8_all(node->lo[1]) - p.y, zero),
                    v8_max(p.z - v8_all(node->hi[2]), zero) - v8_max(v8_all(node->lo[2]) - p.z, zero)};
}

/* Parts in which a node may hold the nearest feature. */
static inline int concerned(const sdm_grid_parts *q, bool aligned, const view8 *v, const sdm_cluster_node *node)
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

static inline void offer_centroids(const sdm_features *f, uint32_t cluster, point8 p, centroid8 *best)
{
    const float(*c)[8] = (const float(*)[8])f->centroid[cluster];
    for (int i = 0; i < 8; i++) {
        const point8 w = p8_sub(p, p8_all(c[0][i], c[1][i], c[2][i]));
        const v8f d2 = p8_dot(w, w);
        best->face = v8_select_i(d2 < best->d2, v8_all_i((int32_t)(8 * cluster) + i), best->face);
        best->d2 = v8_min(d2, best->d2);
    }
}

/* Puts the centroids nearest to the points p in the place of at[3][8], where they are nearer. */
static void find_centroids(const sdm_features *f, point8 p, float at[3][8])
{
    const point8 w = p8_sub(p, p8_load((const float(*)[8])at));
    const float middle[3] = {p.x[0] + p.x[7], p.y[0] + p.y[7], p.z[0] + p.z[7]};
    centroid8 best = {p8_dot(w, w), v8_all_i(-1)};
    uint32_t stack[SDM_CLUSTER_DEPTH];
    int top = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t i = stack[--top];
        const sdm_cluster_node *node = &f->node[i];
        const point8 b = from_box(node, p);
        if (v8_greater(p8_dot(b, b), best.d2) == 0xff) continue;
        if (node->n == 1) {
            offer_centroids(f, node->first, p, &best);
            continue;
        }
        const uint32_t child[2] = {i + 1, node->second};
        float d[2] = {0, 0};
        for (int c = 0; c < 2; c++)
            for (int a = 0; a < 3; a++) d[c] += fabsf(f->node[child[c]].lo[a] + f->node[child[c]].hi[a] - middle[a]);
        const int near = d[1] < d[0];
        stack[top++] = child[!near];
        stack[top++] = child[near];
    }
    for (int i = 0; i < 8; i++) {
        const int32_t k = best.face[i];
        for (int a = 0; a < 3 && k >= 0; a++) at[a][i] = f->centroid[k / 8][a][k % 8];
    }
}

/* Clusters of the tree that concern parts of a box. */
static sdm_status clusters_of_box(const sdm_grid_job *job, const view8 *v, int wanted, sdm_cluster_list *out,
                                  sdm_error *err)
{
    const sdm_features *f = job->features;
    uint32_t stack[SDM_CLUSTER_DEPTH];
    int top = 0;
    out->n = 0;
    stack[top++] = 0;
    while (top) {
        const uint32_t i = stack[--top];
        const sdm_cluster_node *node = &f->node[i];
        const int mask = wanted & concerned(&job->part[SDM_TO_BLOCKS], job->aligned, v, node);
        if (!mask) continue;
        if (node->n > 1) {
            stack[top++] = node->second;
            stack[top++] = i + 1;
            continue;
        }
        if (out->n == out->cap) {
            const sdm_status st = sdm_cluster_list_reserve(out, 2 * out->cap + 64, err);
            if (st) return st;
        }
        out->node[out->n] = i;
        out->mask[out->n++] = (uint8_t)mask;
    }
    return SDM_OK;
}

/* Clusters of one block of the box that concern its tiles; out has room. */
static void clusters_of_block(const sdm_grid_job *job, const sdm_cluster_list *in, int block, const view8 *v,
                              int wanted, sdm_cluster_list *out)
{
    out->n = 0;
    for (size_t i = 0; i < in->n; i++) {
        if (!(in->mask[i] >> block & 1)) continue;
        const sdm_cluster_node *node = &job->features->node[in->node[i]];
        const int mask = wanted & concerned(&job->part[SDM_TO_TILES], job->aligned, v, node);
        out->node[out->n] = in->node[i];
        out->mask[out->n] = (uint8_t)mask;
        out->n += mask != 0;
    }
}

/* Points of the surface near the middles p of the tiles of a block. */
static void refer_tiles(const sdm_grid_job *job, const sdm_cluster_list *in, int block, const double middle[3],
                        point8 p, float at[3][8])
{
    const sdm_features *f = job->features;
    const point8 w = p8_sub(p, p8_load((const float(*)[8])at));
    centroid8 best = {p8_dot(w, w), v8_all_i(-1)};
    for (size_t i = 0; i < in->n; i++) {
        if (!(in->mask[i] >> block & 1)) continue;
        const sdm_cluster_node *node = &f->node[in->node[i]];
        const point8 b = from_box(node, p);
        if (v8_greater(p8_dot(b, b), best.d2) != 0xff) offer_centroids(f, node->first, p, &best);
    }
    for (int i = 0; i < 8; i++) {
        if (best.face[i] < 0) continue;
        double x[3], q[3];
        int feature;
        for (int a = 0; a < 3; a++) x[a] = middle[a] + job->part[SDM_TO_TILES].middle_mm[i][a];
        (void)sdm_frame_closest(&job->surface->frames[f->slot[best.face[i]]], x, q, &feature);
        for (int a = 0; a < 3; a++) at[a][i] = (float)((q[a] - f->centre[a]) * f->scale);
    }
}

static inline point8 gradient(const sdm_feature_group *k, int j) { return p8_load((const float(*)[8])k->g[j]); }

/* Function j of a group at p, with another offset. */
static inline v8f value(const sdm_feature_group *k, int j, v8f offset, point8 p)
{
    return p8_linear(gradient(k, j), p, offset);
}

/* Bounds on the functions of a group over a tile: what reach_ functions ask for. */
typedef struct bound8 {
    v8f f[SDM_CORNER_EDGES];
} bound8;

static inline bound8 bound_faces(const sdm_grid_job *job, const sdm_feature_group *k)
{
    bound8 b;
    for (int j = 0; j < 3; j++)
        b.f[j] =
            v8_load(k->offset[j]) - extent(&job->part[SDM_TO_TILES], job->aligned, gradient(k, j)) - v8_all(job->error);
    return b;
}

static inline bound8 bound_edges(const sdm_grid_job *job, const sdm_feature_group *k)
{
    bound8 b = bound_faces(job, k);
    b.f[0] =
        v8_load(k->offset[3]) + extent(&job->part[SDM_TO_TILES], job->aligned, gradient(k, 0)) + v8_all(job->error);
    return b;
}

static inline bound8 bound_corners(const sdm_grid_job *job, const sdm_corner_group *k)
{
    const point8 at = p8_load((const float(*)[8])k->at);
    bound8 b;
    for (int j = 0; j < SDM_CORNER_EDGES; j++) {
        const point8 g = p8_load((const float(*)[8])k->along[j]);
        b.f[j] = v8_all(0) - extent(&job->part[SDM_TO_TILES], job->aligned, g) - v8_all(job->error) - p8_dot(g, at);
    }
    return b;
}

/* Lanes of a group that may hold the nearest feature somewhere in a tile. */
static inline int reach_faces(const sdm_grid_job *job, const sdm_feature_group *k, int thin, const bound8 *b,
                              const view8 *v)
{
    const v8f over = v8_max(value(k, 0, b->f[0], v->p), v8_max(value(k, 1, b->f[1], v->p), value(k, 2, b->f[2], v->p)));
    const int lanes = 0xff & ~v8_greater(over, v8_all(0));
    if (!lanes) return 0;
    const v8f z = value(k, 3, v8_load(k->offset[3]), v->p);
    const point8 n = gradient(k, 3), g = {v8_turn(n.x, z), v8_turn(n.y, z), v8_turn(n.z, z)};
    return lanes & (thin | ~v8_greater(v8_abs(z), limit8(&job->part[SDM_TO_TILES], job->aligned, v, g)));
}

static inline int reach_edges(const sdm_grid_job *job, const sdm_feature_group *k, const bound8 *b, const view8 *v)
{
    const v8f t = value(k, 0, v8_load(k->offset[0]), v->p);
    const v8f over = v8_max(v8_abs(t) - b->f[0], v8_max(value(k, 1, b->f[1], v->p), value(k, 2, b->f[2], v->p)));
    const int lanes = 0xff & ~v8_greater(over, v8_all(0));
    if (!lanes) return 0;
    point8 g;
    const v8f d = length8(p8_sub(p8_sub(v->p, gradient(k, 3)), p8_scale(gradient(k, 0), t)), &g);
    return lanes & ~v8_greater(d, limit8(&job->part[SDM_TO_TILES], job->aligned, v, g));
}

static inline int reach_corners(const sdm_grid_job *job, const sdm_corner_group *k, const bound8 *b, const view8 *v)
{
    v8f over = v8_all(-1);
    for (int j = 0; j < SDM_CORNER_EDGES; j++)
        over = v8_max(over, p8_linear(p8_load((const float(*)[8])k->along[j]), v->p, b->f[j]));
    const int lanes = 0xff & ~v8_greater(over, v8_all(0));
    if (!lanes) return 0;
    point8 g;
    const v8f d = length8(p8_sub(v->p, p8_load((const float(*)[8])k->at)), &g);
    return lanes & ~v8_greater(d, limit8(&job->part[SDM_TO_TILES], job->aligned, v, g));
}

static inline void append(const sdm_grid_job *job, sdm_candidates *out, int kind, uint32_t number, int lanes)
{
    if (!lanes) return;
    v8_permute(&out->list[kind][out->n[kind]], v8_from_i((int32_t)number), job->lanes_of[lanes]);
    out->n[kind] += (unsigned)__builtin_popcount((unsigned)lanes);
}

/* Features of the tiles of a block from its clusters. */
static void share_out(const sdm_grid_job *job, sdm_grid_scratch *s, const sdm_points *middle, const reference8 *n)
{
    const sdm_features *f = job->features;
    view8 view[8];
    for (int t = 0; t < 8; t++) {
        view[t] = view_one(n, middle, t);
        for (int k = 0; k < SDM_FEATURE_KINDS; k++) s->tile[t].n[k] = 0;
    }
    // a group stays in the first-level cache while the tiles look at it
    for (size_t i = 0; i < s->block.n; i++) {
        const uint32_t c = f->node[s->block.node[i]].first;
        const unsigned mask = s->block.mask[i];
        bound8 b = bound_faces(job, &f->face[c]);
        for (unsigned m = mask; m; m &= m - 1) {
            const int t = __builtin_ctz(m);
            append(job, &s->tile[t], SDM_FACES, 8 * c, reach_faces(job, &f->face[c], f->thin[c], &b, &view[t]));
        }
        for (uint32_t j = f->edge_first[c]; j < f->edge_first[c + 1]; j++) {
            b = bound_edges(job, &f->edge[j]);
            for (unsigned m = mask; m; m &= m - 1) {
                const int t = __builtin_ctz(m);
                append(job, &s->tile[t], SDM_EDGES, f->edge_base + 8 * j, reach_edges(job, &f->edge[j], &b, &view[t]));
            }
        }
        for (uint32_t j = f->corner_first[c]; j < f->corner_first[c + 1]; j++) {
            b = bound_corners(job, &f->corner[j]);
            for (unsigned m = mask; m; m &= m - 1) {
                const int t = __builtin_ctz(m);
                append(job, &s->tile[t], SDM_CORNERS, f->corner_base + 8 * j,
                       reach_corners(job, &f->corner[j], &b, &view[t]));
            }
        }
    }
}

#endif
