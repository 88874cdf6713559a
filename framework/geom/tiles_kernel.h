/* From the clusters of a block to the features of its tiles. Part of the map kernels. */
#ifndef SDM_GEOM_TILES_KERNEL_H
#define SDM_GEOM_TILES_KERNEL_H

#include "clusters_kernel.h"
#include "features_kernel.h"

/* A block's features as they are shared out to its tiles. */
typedef struct sharing {
    const sdm_grid_job *job;
    sdm_grid_scratch *s;
    const sdm_grid_parts *block, *tile; /* one of them each */
    point8 p;                           /* middles of the tiles, from that of the block */
    float error;
} sharing;

/* Appends the features of some lanes of a group that begins with `number` behind the first n; returns how many there are then. Without
   branches: who meets the block cannot be foreseen. */
static inline size_t put_features(const sharing *w, size_t n, uint32_t number, size_t cluster, unsigned lanes)
{
    v8_permute(&w->s->number[n], v8_from_i((int32_t)number), w->job->lanes_of[lanes]);
    v8_store_i(&w->s->from[n], v8_all_i((int32_t)cluster));
    return n + (unsigned)__builtin_popcount(lanes);
}

/* Function k of a group at the middle of the block, less what it may change to the block's corners. */
static inline v8f least8(const sharing *w, const sdm_feature_group *k, int j, point8 shift)
{
    const point8 g = p8_load(k->g[j]);
    return p8_linear(g, shift, v8_load(k->offset[j])) - extent(w->block, w->job->aligned, g);
}

/* Lanes of a group of faces whose regions meet the block. */
static inline unsigned faces_met(const sharing *w, const sdm_feature_group *k, point8 shift)
{
    const v8f beside = v8_max(least8(w, k, 0, shift), v8_max(least8(w, k, 1, shift), least8(w, k, 2, shift)));
    return 0xff & ~(unsigned)v8_greater(beside, v8_all(w->error));
}

static size_t meet_faces(const sharing *w, bool thin, size_t n)
{
    const sdm_features *f = w->job->features;
    for (size_t i = 0; i < w->s->n_cluster; i++) {
        const sdm_cluster_ref *c = &w->s->cluster[i];
        const sdm_cluster_node *node = &f->node[c->node];
        if (thin && !node->thin) continue;
        const point8 shift = p8_all(c->shift[0], c->shift[1], c->shift[2]);
        const unsigned lanes = faces_met(w, &f->group[node->group], shift);
        n = put_features(w, n, node->first, i, thin ? lanes & node->thin : lanes & ~node->thin);
    }
    return n;
}

/* Lanes of a group of edges whose regions meet the block. */
static inline unsigned edges_met(const sharing *w, const sdm_feature_group *k, point8 shift)
{
    const point8 g = p8_load(k->g[0]);
    const v8f along = v8_abs(p8_linear(g, shift, v8_load(k->offset[0]))) - extent(w->block, w->job->aligned, g);
    const v8f beyond = v8_max(along - v8_load(k->offset[3]), v8_max(least8(w, k, 1, shift), least8(w, k, 2, shift)));
    return 0xff & ~(unsigned)v8_greater(beyond, v8_all(w->error));
}

static size_t meet_edges(const sharing *w, size_t n)
{
    const sdm_features *f = w->job->features;
    for (size_t i = 0; i < w->s->n_cluster; i++) {
        const sdm_cluster_ref *c = &w->s->cluster[i];
        const sdm_cluster_node *node = &f->node[c->node];
        const point8 shift = p8_all(c->shift[0], c->shift[1], c->shift[2]);
        const sdm_feature_group *group = &f->group[node->group + 1];
        for (uint32_t number = node->edge; number < node->edge_end; number += 8, group++)
            n = put_features(w, n, number, i, edges_met(w, group, shift));
    }
    return n;
}

static size_t meet_corners(const sharing *w, size_t n)
{
    const sdm_features *f = w->job->features;
    const sdm_grid_scratch *s = w->s;
    for (size_t i = 0; i < s->n_cluster; i++) {
        const sdm_cluster_ref *c = &s->cluster[i];
        const sdm_cluster_node *node = &f->node[c->node];
        for (uint32_t number = node->corner; number < node->corner_end; number++) {
            const sdm_corner_row *k = &f->corner[number - f->corner_base];
            const point8 g = p8_load(k->along);
            const v8f at_middle =
                p8_dot(g, p8_all(c->shift[0] - k->at[0], c->shift[1] - k->at[1], c->shift[2] - k->at[2]));
            const int beyond = v8_greater(at_middle - extent(w->block, w->job->aligned, g), v8_all(w->error));
            s->number[n] = number;
            s->from[n] = (uint32_t)i;
            n += (beyond & ((1 << SDM_CORNER_EDGES) - 1)) == 0;
        }
    }
    return n;
}

/* Fills in the rows of the features and the tiles that their regions meet. How far they are, their clusters were asked: of those that are
   left hardly any feature is too far from a tile or vector whose region it meets. */
static inline void hit_faces(const sharing *w, bool thin, size_t from, size_t to)
{
    const sdm_grid_scratch *s = w->s;
    for (size_t i = from; i < to; i++) {
        const sdm_cluster_ref *c = &s->cluster[s->from[i]];
        const sdm_feature_row *r = &w->job->features->row[s->number[i]];
        const row4 x = shift_face(load_row(r), c->shift);
        const float4 low = lowered(&x, reach_of(w->tile, w->job->aligned, &x, w->error));
        store_row(&s->row[i], x);
        const v8f beyond = thin ? beyond_thin_face(r, &low, w->p) : beyond_face(r, &low, w->p);
        s->row_hit[i] = (uint8_t)(c->mask & ~(unsigned)v8_greater(beyond, v8_all(0)));
    }
}

static void hit_edges(const sharing *w, size_t from, size_t to)
{
    const sdm_grid_scratch *s = w->s;
    for (size_t i = from; i < to; i++) {
        const sdm_cluster_ref *c = &s->cluster[s->from[i]];
        const sdm_feature_row *r = &s->row[i];
        const row4 x = shift_edge(load_row(&w->job->features->row[s->number[i]]), c->shift);
        const v4f reach = reach_of(w->tile, w->job->aligned, &x, w->error);
        const float4 low = lowered(&x, reach);
        store_row(&s->row[i], x);
        const v8f along = function8(r, 0, r->offset[0], w->p);
        const v8f beyond = beyond_edge(r, &low, along, r->offset[3] + reach[0], w->p);
        s->row_hit[i] = (uint8_t)(c->mask & ~(unsigned)v8_greater(beyond, v8_all(0)));
    }
}

static void hit_corners(const sharing *w, size_t from, size_t to)
{
    const sdm_features *f = w->job->features;
    for (size_t i = from; i < to; i++) {
        const sdm_corner_row *k = &f->corner[w->s->number[i] - f->corner_base];
        const sdm_cluster_ref *c = &w->s->cluster[w->s->from[i]];
        for (int a = 0; a < 3; a++) w->s->row[i].g[a][3] = k->at[a] - c->shift[a];
        const point8 x = p8_sub(w->p, point_of(&w->s->row[i]));
        const v8f beyond = beyond_corner_part(w->tile, w->job->aligned, k, w->error, x);
        w->s->row_hit[i] = (uint8_t)(c->mask & ~(unsigned)v8_greater(beyond, v8_all(0)));
    }
}

/* Features of the tiles of a block from its clusters. */
static sdm_status share_out(const sdm_grid_job *job, sdm_grid_scratch *s, float error, sdm_error *err)
{
    const point8 p = p8_load((const float(*)[8])job->part[SDM_TO_TILES].middle.x);
    const sharing w = {.job = job,
                       .s = s,
                       .block = &job->part[SDM_TO_BLOCKS],
                       .tile = &job->part[SDM_TO_TILES],
                       .p = p,
                       .error = error};
    // the hits of a kind begin at a multiple of eight
    size_t from[SDM_FEATURE_KINDS], to[SDM_FEATURE_KINDS];
    to[SDM_FACES] = meet_faces(&w, false, from[SDM_FACES] = 0);
    to[SDM_THIN_FACES] = from[SDM_THIN_FACES] = (to[SDM_FACES] + 7) / 8 * 8;
    if (job->features->any_thin) to[SDM_THIN_FACES] = meet_faces(&w, true, from[SDM_THIN_FACES]);
    to[SDM_EDGES] = meet_edges(&w, from[SDM_EDGES] = (to[SDM_THIN_FACES] + 7) / 8 * 8);
    to[SDM_CORNERS] = meet_corners(&w, from[SDM_CORNERS] = (to[SDM_EDGES] + 7) / 8 * 8);
    const sdm_status st = sdm_grid_scratch_rows(s, to[SDM_CORNERS] + 1, job->limit, err);
    if (st) return st;
    hit_faces(&w, false, from[SDM_FACES], to[SDM_FACES]);
    hit_faces(&w, true, from[SDM_THIN_FACES], to[SDM_THIN_FACES]);
    hit_edges(&w, from[SDM_EDGES], to[SDM_EDGES]);
    hit_corners(&w, from[SDM_CORNERS], to[SDM_CORNERS]);
    for (int kind = 0; kind < SDM_FEATURE_KINDS; kind++)
        list_hits(job, s->row_hit, NULL, from[kind], to[kind], s->tile, kind);
    return SDM_OK;
}

#endif
