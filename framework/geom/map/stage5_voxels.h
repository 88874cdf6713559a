/* From the features of a block to the squared distances of its voxels. Part of the map kernels. */
#ifndef SDM_GEOM_VOXELS_KERNEL_H
#define SDM_GEOM_VOXELS_KERNEL_H

#include "stage4_tiles.h"

static void start_candidates(sdm_candidates *c)
{
    c->n = 0;
    for (int v = 0; v < 64; v++) {
        v8_store(c->first[v], v8_all(INFINITY));
        v8_store(c->second[v], v8_all(INFINITY));
        v8_store_i(c->number[v], v8_all_i(0));
        c->last[v] = SDM_NONE;
        c->open[v] = 0;
    }
}

/* The bound on the error of a squared distance d^2 is 2 (d + 1) 2 error, of two of them, doubled,
 * this times (d + 1). */
static inline float doubt_of(float error) { return 8 * error; }

/* One more candidate of a vector: feature `number` at squared distances d. Returns the voxels that
   it may be nearest to. doubt: more than two of them may differ by where their order is open, as it
   may be for d^2 = 0; and for others as a share of them. */
SDM_FOR_KIND unsigned compete(sdm_candidates *c, unsigned v, v8i number, v8f d, v8f doubt,
                              v8f share)
{
    const v8f first = v8_load(c->first[v]), nearest = v8_min(d, first);
    v8_store(c->second[v], v8_min(v8_load(c->second[v]), v8_max(d, first)));
    v8_store_i(c->number[v], v8_if_less(d, first, number, v8_load_i(c->number[v])));
    v8_store(c->first[v], nearest);
    return (unsigned)v8_greater(v8_fma(nearest, share, doubt), d);
}

/* Squared distances of a feature: INFINITY where a voxel is surely not in the region. at: its
   functions at the middle of the vector, each eight floats after the one before; v: the vector. */
SDM_FOR_KIND v8f distances(const sdm_grid_job *job, int kind, const sdm_block_feature *x,
                           const float *at, unsigned v, v8f error)
{
    v8f f[SDM_FUNCTIONS];
    for (int k = 0; k < functions_of(kind); k++)
        f[k] = v8_add(v8_load(x->to_voxels[k]), v8_all(at[8 * k]));
    v8f d = v8_mul(f[3], f[3]), most = f[0];
    if (kind == SDM_EDGES) {
        d = v8_fma(f[1], f[1], d);
        most = v8_sub(v8_abs(f[0]), v8_all(x->most[0]));
        f[1] = v8_sub(f[1], v8_all(x->most[1])); // may be INFINITY
    }
    most = v8_max(most, v8_max(f[1], f[2]));
    if (kind == SDM_THIN_FACES) most = v8_max(most, f[3]);
    if (kind == SDM_CORNERS) {
        // without its region the end of an edge would be in doubt as far as the root of the error
        const point8 from = p8_add(p8_load((const float(*)[8])job->voxel[v / 8][v % 8].x),
                                   p8_all(x->from[0], x->from[1], x->from[2]));
        d = p8_dot(from, from);
        most = v8_max(v8_max(most, f[3]), v8_max(f[4], f[5]));
    }
    return v8_signed(v8_sub(most, error), d, v8_all(INFINITY));
}

/* Holds the voxels of n vectors against the features of the batch whose region these meet. */
SDM_FOR_KIND void compare(const block *b, int kind, size_t n)
{
    const sdm_batch *batch = b->s->batch;
    sdm_candidates *c = b->s->of_vectors;
    const v8f error = v8_all(b->error), doubt = v8_all(2 * doubt_of(b->error)),
              share = v8_all(1 + doubt_of(b->error));
    uint32_t end = (uint32_t)c->n;
    for (size_t i = 0; i < n; i++) {
        const uint32_t place = batch->vector[i];
        const sdm_tile_pair *pair = &batch->pair[place / SDM_FLOATS(batch->at_vectors[0])];
        const sdm_block_feature *x =
            (const sdm_block_feature *)(const void *)((const float *)batch->feature +
                                                      pair->feature);
        const unsigned v = pair->vector + place % 8;
        const uint32_t number = x->number, before = c->last[v];
        const v8f d = distances(b->job, kind, x, &batch->at_vectors[0][0][0] + place, v, error);
        unsigned may;
        if (kind == SDM_THIN_FACES)
            c->open[v] |= may =
                (unsigned)v8_greater(v8_all(INFINITY), d); // how far it is float cannot tell
        else
            may = compete(c, v, v8_all_i((int32_t)number), d, doubt, share);
        c->list[end] = (sdm_candidate){number, before, may};
        c->last[v] = end++;
    }
    c->n = end;
}

/* The features of one kind that wait against the voxels. */
SDM_FOR_KIND sdm_status hold_batch(block *b, int kind, sdm_error *err)
{
    sdm_pending *p = &b->s->pending[kind];
    const size_t n = hit_vectors(b, kind, hit_tiles(b, kind));
    p->n = p->groups = 0;
    const sdm_status st =
        sdm_grid_scratch_candidates(b->s, b->s->of_vectors->n + n, b->job->limit, err);
    if (!st) compare(b, kind, n);
    return st;
}

typedef sdm_status hold_kind(block *b, sdm_error *err);
static sdm_status hold_faces(block *b, sdm_error *err) { return hold_batch(b, SDM_FACES, err); }
static sdm_status hold_thin_faces(block *b, sdm_error *err)
{
    return hold_batch(b, SDM_THIN_FACES, err);
}
static sdm_status hold_edges(block *b, sdm_error *err) { return hold_batch(b, SDM_EDGES, err); }
static sdm_status hold_corners(block *b, sdm_error *err) { return hold_batch(b, SDM_CORNERS, err); }
static hold_kind *const hold[SDM_FEATURE_KINDS] = {hold_faces, hold_thin_faces, hold_edges,
                                                   hold_corners};

static inline bool is_full(const sdm_pending *p) { return p->n > SDM_BATCH - 8; }

/* The features of the block's clusters against its voxels. cube: it is one, along x, y, z. */
SDM_FOR_KIND sdm_status hold_clusters(block *b, bool cube, sdm_error *err)
{
    const sdm_features *f = b->job->features;
    const meeting w = meeting_of(b);
    sdm_pending *wait = b->s->pending, *faces = &wait[SDM_FACES], *edges = &wait[SDM_EDGES],
                *corners = &wait[SDM_CORNERS], *thin = &wait[SDM_THIN_FACES];
    sdm_status st = SDM_OK;
    for (int kind = 0; kind < SDM_FEATURE_KINDS; kind++) wait[kind].n = wait[kind].groups = 0;
    start_candidates(b->s->of_vectors);
    for (size_t i = 0; i < b->s->n_cluster && !st; i++) {
        const sdm_cluster_ref *c = &b->s->cluster[i];
        const sdm_cluster_node *node = &f->node[c->node];
        const sdm_feature_group *group = &f->group[node->group];
        keep_group(b, faces, node->first,
                   meet_group(&w, cube, SDM_FACES, group, c, &faces->met[faces->groups]) &
                       ~node->thin);
        if (is_full(faces)) st = hold[SDM_FACES](b, err);
        if (node->thin) {
            keep_group(b, thin, node->first,
                       meet_group(&w, cube, SDM_THIN_FACES, group, c, &thin->met[thin->groups]) &
                           node->thin);
            if (is_full(thin) && !st) st = hold[SDM_THIN_FACES](b, err);
        }
        for (uint32_t number = node->edge; number < node->edge_end && !st; number += 8) {
            keep_group(b, edges, number,
                       meet_group(&w, cube, SDM_EDGES, ++group, c, &edges->met[edges->groups]));
            if (is_full(edges)) st = hold[SDM_EDGES](b, err);
        }
        for (uint32_t number = node->corner; number < node->corner_end && !st;
             number += SDM_CORNER_LANES) {
            keep_group(
                b, corners, number,
                meet_group(&w, cube, SDM_CORNERS, ++group, c, &corners->met[corners->groups]));
            if (is_full(corners)) st = hold[SDM_CORNERS](b, err);
        }
    }
    for (int kind = 0; kind < SDM_FEATURE_KINDS && !st; kind++)
        if (wait[kind].n) st = hold[kind](b, err);
    return st;
}

static sdm_status hold_features(block *b, sdm_error *err)
{
    return is_cube(b->job) ? hold_clusters(b, true, err) : hold_clusters(b, false, err);
}

#endif
