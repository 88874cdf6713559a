/* Stage 5: computes, in float, the squared distances from the voxels of a vector to each feature
   that passed stage 4, and collects the candidates of every vector. Part of map.inc. */
#pragma once

#include "block.h"
#include "lists.h"
#include "regions.h"

static void candidates_clear(sdm_candidates *c)
{
    c->n = 0;
    for (int v = 0; v < 64; v++) {
        v8_store(c->first[v], v8_all(INFINITY));
        v8_store(c->second[v], v8_all(INFINITY));
    }
    memset(c->last, 0xff, sizeof c->last); // SDM_NONE
    memset(c->open, 0, sizeof c->open);
}

/* Squared distances in float of the voxels of a vector of a tile to feature x; INFINITY for
   voxels that are surely outside of its region. at[function][vector]: sdm_batch.at_vectors of the
   feature's tile pair. */
SDM_FOR_KIND v8f feature_distances(const sdm_grid_job *job, int kind, const sdm_block_feature *x,
                                   const float (*at)[8], size_t tile, size_t vector, v8f error)
{
    v8f f[SDM_FUNCTIONS];
    for (int k = 0; k < functions_of(kind); k++)
        f[k] = v8_add(v8_load(x->to_voxels[k]), v8_all(at[k][vector]));
    // excess: by how much a voxel lies outside of the region
    v8f d2 = v8_mul(f[3], f[3]), excess = f[0];
    if (kind == SDM_EDGES) {
        d2 = v8_fma(f[1], f[1], d2);
        excess = v8_sub(v8_abs(f[0]), v8_all(x->most[0]));
        f[1] = v8_sub(f[1], v8_all(x->most[1])); // -INFINITY if most[1] is INFINITY
    }
    excess = v8_max(excess, v8_max(f[1], f[2]));
    if (kind == SDM_THIN_FACES) excess = v8_max(excess, f[3]);
    if (kind == SDM_CORNERS) {
        // The region test matters: without it an edge and its end corner would be ambiguous within
        // sqrt(error) of the end, instead of within error.
        const point8 from =
            p8_add(p8_load(job->voxel[tile][vector].x), p8_all(x->from[0], x->from[1], x->from[2]));
        d2 = p8_dot(from, from);
        excess = v8_max(v8_max(excess, f[3]), v8_max(f[4], f[5]));
    }
    return v8_if_negative(v8_sub(excess, error), d2, v8_all(INFINITY));
}

/* Updates the two nearest candidates of each voxel of vector v by feature `number`, whose squared
   distances from the voxels are d2. Returns the mask of the voxels to which the feature may be the
   nearest: d2 < min * share + slack, where min is the smallest squared distance so far, k =
   ambiguity(), share = 1 + k and slack = 2 k. This limit is an upper bound on min + k (sqrt(min) +
   1) and needs no square root. */
SDM_FOR_KIND unsigned candidate_compare(sdm_candidates *c, size_t v, v8i number, v8f d2, v8f slack,
                                        v8f share)
{
    const v8f first = v8_load(c->first[v]), nearest = v8_min(d2, first);
    v8_store(c->second[v], v8_min(v8_load(c->second[v]), v8_max(d2, first)));
    v8_store_i(c->number[v], v8_if_less(d2, first, number, v8_load_i(c->number[v])));
    v8_store(c->first[v], nearest);
    return (unsigned)v8_greater(v8_fma(nearest, share, slack), d2);
}

/* Appends one candidate for each vector pair (a feature and a vector of voxels) of the batch to
   scratch->candidates, which has room for them. */
SDM_FOR_KIND void batch_measure(const block *b, int kind)
{
    const sdm_batch *batch = b->scratch->batch;
    sdm_candidates *c = b->scratch->candidates;
    const v8f error = v8_all(b->error), slack = v8_all(2 * ambiguity(b->error)),
              share = v8_all(1 + ambiguity(b->error));
    const size_t n = batch->n_vector_pair;
    uint32_t end = (uint32_t)c->n;
    for (size_t i = 0; i < n; i++) {
        const size_t pair = lane_item(batch->vector_pair[i], batch->n_tile_pair);
        const size_t of_tile = batch->tile_pair[pair];
        const size_t tile = lane_of(of_tile), vector = lane_of(batch->vector_pair[i]);
        const size_t v = 8 * tile + vector;
        const sdm_block_feature *x = &batch->feature[lane_item(of_tile, batch->n_feature)];
        const uint32_t number = x->number, before = c->last[v];
        const v8f d2 =
            feature_distances(b->job, kind, x, batch->at_vectors[pair], tile, vector, error);
        // the distance of a thin face is too inaccurate in float: leave its voxels to stage 6
        unsigned voxels;
        if (kind == SDM_THIN_FACES)
            c->open[v] |= voxels = (unsigned)v8_greater(v8_all(INFINITY), d2);
        else
            voxels = candidate_compare(c, v, v8_all_i((int32_t)number), d2, slack, share);
        assert(end < c->cap);
        c->list[end] = (sdm_candidate){number, before, voxels};
        c->last[v] = end++;
    }
    c->n = end;
}
