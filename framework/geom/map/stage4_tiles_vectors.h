/* Stage 4: a batch of features of one kind is tested against the tiles of the block, then against
   the vectors of these tiles. Part of map.inc. */
#pragma once

#include "block.h"
#include "lists.h"
#include "regions.h"

/* Prepares the feature in a lane of a group for the parts of the block: fills x, and returns its
   functions at the centres of the tiles. to_voxel: sdm_grid_job.to_voxel. */
SDM_FOR_KIND functions8 block_feature_start(const sdm_grid_job *job, int kind, point8 to_voxel,
                                            const sdm_block_group *m, size_t lane,
                                            sdm_block_feature *x)
{
    // a copy: the compiler would load m->group again after each v8_store()
    const sdm_feature_group *group = m->group;
    functions8 tile;
    x->number = m->number + (uint32_t)lane;
    x->extent = m->extent;
    x->lane = lane;
    for (int k = 0; k < 2 && kind == SDM_EDGES; k++) x->most[k] = group->most[k][lane];
    for (int a = 0; a < 3 && kind == SDM_CORNERS; a++)
        x->from[a] = m->cluster->shift[a] - group->g[3][a][lane];
    // offsets of tiles are 4 times those of voxels, if the grid is self-similar
    for (int k = 0; k < functions_of(kind); k++) {
        const v8f step = p8_dot(function_gradient(kind, group, k, lane), to_voxel);
        v8_store(x->to_voxels[k], step);
        tile.f[k] = v8_fma(step, v8_all(4), v8_all(function_value(kind, m->at_block, k, lane)));
    }
    // else each level has its own offsets
    if (!job->self_similar) {
        const point8 vectors = p8_load(job->part[SDM_VECTORS].centre.x);
        const point8 tiles = p8_load(job->part[SDM_TILES].centre.x);
        for (int k = 0; k < functions_of(kind); k++) {
            const point8 g = function_gradient(kind, group, k, lane);
            v8_store(x->to_vectors[k], p8_dot(g, vectors));
            tile.f[k] = p8_linear(g, tiles, v8_all(function_value(kind, m->at_block, k, lane)));
        }
    }
    for (int k = 0; k < functions_of(kind); k++) v8_store(x->at_tiles[k], tile.f[k]);
    return tile;
}

/* Moves the queued features into the batch and lists the pairs of a feature and a tile that meets
   its region and, with a narrow band, is near it. Without a band there is no distance test here:
   clusters were culled by distance from the tiles, which rejects almost all far features. */
SDM_FOR_KIND void batch_test_tiles(block *b, int kind)
{
    const sdm_grid_job *job = b->job;
    const sdm_pending *p = &b->scratch->pending[kind];
    const size_t n_feature = p->n, n_group = p->n_group;
    const point8 to_voxel = p8_load(job->to_voxel.x);
    const v8f minus_half = v8_all(-b->half[SDM_TILES]), error = v8_all(b->error);
    sdm_batch *batch = b->scratch->batch;
    unsigned met = 0;
    size_t n = 0;
    for (size_t i = 0; i < n_feature; i++) {
        const size_t lane = lane_of(p->feature[i]);
        const sdm_block_group *m = &p->group[lane_item(p->feature[i], n_group)];
        sdm_block_feature *x = &batch->feature[i];
        // for stage 6
        __builtin_prefetch(&job->features->exact[m->number + (uint32_t)lane]);
        const functions8 f = block_feature_start(job, kind, to_voxel, m, lane, x);
        v8f excess = region_excess(kind, &f, m->extent, lane, minus_half, x->most);
        if (kind != SDM_THIN_FACES && b->tile_far2 < INFINITY) {
            point8 from = p8_load(job->part[SDM_TILES].centre.x);
            if (kind == SDM_CORNERS)
                from = p8_add(from, p8_all(x->from[0], x->from[1], x->from[2]));
            excess =
                v8_max(excess, v8_sub(function_distance2(kind, &f, from), v8_all(b->tile_far2)));
        }
        const unsigned mask = m->cluster->tiles & ~(unsigned)v8_greater(excess, error);
        met |= mask;
        n = lanes_append(job, batch->tile_pair, n, 8 * SDM_BATCH + 8, i, mask);
    }
    b->tiles_met |= met;
    batch->n_feature = n_feature;
    batch->n_tile_pair = n;
}

/* For each pair (feature, tile) of the batch, lists the pairs of this feature and a vector of the
   tile for which the vector meets the feature's region and the feature is near enough to be the
   nearest at one of the vector's voxels. */
SDM_FOR_KIND void batch_test_vectors(const block *b, int kind)
{
    const sdm_grid_job *job = b->job;
    const bool similar = job->self_similar;
    const v8f factor = v8_all(similar ? 2 : 1), error = v8_all(b->error);
    const v8f minus_half = v8_all(-b->half[SDM_VECTORS]);
    sdm_batch *batch = b->scratch->batch;
    const size_t n_feature = batch->n_feature, n_tile_pair = batch->n_tile_pair;
    size_t n = 0;
    for (size_t i = 0; i < n_tile_pair; i++) {
        // the functions at the centres of the tile's vectors
        const size_t t = lane_of(batch->tile_pair[i]);
        const sdm_block_feature *x = &batch->feature[lane_item(batch->tile_pair[i], n_feature)];
        const float(*step)[8] = similar ? x->to_voxels : x->to_vectors;
        functions8 f;
        for (int k = 0; k < functions_of(kind); k++) {
            f.f[k] = v8_fma(v8_load(step[k]), factor, v8_all(x->at_tiles[k][t]));
            v8_store(batch->at_vectors[i][k], f.f[k]);
        }
        // excess > error: the vector lies outside of the region, or the feature is farther than
        // block.far2 allows
        v8f excess = region_excess(kind, &f, x->extent, x->lane, minus_half, x->most);
        if (kind != SDM_THIN_FACES) {
            point8 from = p8_load(job->vector[t].x);
            if (kind == SDM_CORNERS)
                from = p8_add(from, p8_all(x->from[0], x->from[1], x->from[2]));
            const v8f d2 = function_distance2(kind, &f, from);
            excess = v8_max(excess, v8_sub(d2, v8_load(b->far2[t])));
        }
        const unsigned mask = ~(unsigned)v8_greater(excess, error) & b->vectors_in_grid[t];
        n = lanes_append(job, batch->vector_pair, n, 64 * SDM_BATCH + 8, i, mask);
    }
    batch->n_vector_pair = n;
}
