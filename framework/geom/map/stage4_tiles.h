/* A batch of features of one kind against the tiles of a block, and its vectors. Part of the map
 * kernels. */
#ifndef SDM_GEOM_BATCH_KERNEL_H
#define SDM_GEOM_BATCH_KERNEL_H

#include "stage3_groups.h"

/* Functions of the feature in a lane of a group at the middles of the tiles, and what they change
 * by from there on. */
SDM_FOR_KIND functions8 place_feature(const sdm_grid_job *job, int kind, point8 to_voxel,
                                      const sdm_met_group *m, uint32_t lane, sdm_block_feature *x)
{
    const float *g = &m->group->g[0][0][lane], *at = &m->at_block[0][lane];
    functions8 tile;
    x->number = m->number + lane;
    x->sum = &m->sum[0][lane];
    for (int k = 0; k < 2 && kind == SDM_EDGES; k++) x->most[k] = m->group->most[k][lane];
    for (int a = 0; a < 3 && kind == SDM_CORNERS; a++)
        x->from[a] = m->cluster->shift[a] - m->group->g[3][a][lane];
    for (int k = 0; k < functions_of(kind); k++) {
        const float *own = g + place_of(kind, k, 3);
        const v8f step = p8_dot(p8_all(own[0], own[8], own[16]), to_voxel);
        v8_store(x->to_voxels[k], step);
        tile.f[k] = v8_fma(step, v8_all(4), v8_all(at[place_of(kind, k, 1)]));
    }
    if (!job->alike) {
        const point8 vectors = p8_load((const float(*)[8])job->part[SDM_TO_VECTORS].middle.x);
        const point8 tiles = p8_load((const float(*)[8])job->part[SDM_TO_TILES].middle.x);
        for (int k = 0; k < functions_of(kind); k++) {
            const float *own = g + place_of(kind, k, 3);
            const point8 gradient = p8_all(own[0], own[8], own[16]);
            v8_store(x->to_vectors[k], p8_dot(gradient, vectors));
            tile.f[k] = p8_linear(gradient, tiles, v8_all(at[place_of(kind, k, 1)]));
        }
    }
    for (int k = 0; k < functions_of(kind); k++) v8_store(x->at_tiles[k], tile.f[k]);
    return tile;
}

/* Takes the features that wait into the batch and lists the tiles that meet their regions; returns
   how many. How far a feature is its cluster was asked: of those that are left hardly any is too
   far from a tile. */
SDM_FOR_KIND size_t hit_tiles(block *b, int kind)
{
    const sdm_grid_job *job = b->job;
    const sdm_pending *p = &b->s->pending[kind];
    const size_t n_feature = p->n;
    const point8 to_voxel = p8_load((const float(*)[8])job->to_voxel.x);
    const v8f less = v8_all(-b->half[SDM_TO_TILES]), error = v8_all(b->error);
    sdm_batch *batch = b->s->batch;
    unsigned met = 0;
    size_t n = 0;
    for (size_t i = 0; i < n_feature; i++) {
        const uint32_t lane = p->feature[i] % 8;
        const sdm_met_group *m =
            (const sdm_met_group *)(const void *)((const float *)p->met + (p->feature[i] - lane));
        sdm_block_feature *x = &batch->feature[i];
        const functions8 f = place_feature(job, kind, to_voxel, m, lane, x);
        const unsigned mask =
            m->cluster->mask &
            ~(unsigned)v8_greater(beyond(kind, &f, &m->sum[0][lane], less, x->most), error);
        met |= mask;
        n = put_lanes(job, batch->tile, n, (uint32_t)(i * SDM_FLOATS(sdm_block_feature)), mask);
    }
    b->met |= met;
    return n;
}

/* Lists the vectors that meet the batch's features; returns how many. */
SDM_FOR_KIND size_t hit_vectors(const block *b, int kind, size_t n_tile)
{
    const sdm_grid_job *job = b->job;
    const bool alike = job->alike;
    const v8f factor = v8_all(alike ? 2 : 1), error = v8_all(b->error);
    const v8f less = v8_all(-b->half[SDM_TO_VECTORS]);
    sdm_batch *batch = b->s->batch;
    size_t n = 0;
    for (size_t i = 0; i < n_tile; i++) {
        const uint32_t t = batch->tile[i] % 8, place = batch->tile[i] - t;
        const sdm_block_feature *x =
            (const sdm_block_feature *)(const void *)((const float *)batch->feature + place);
        const float(*step)[8] = alike ? x->to_voxels : x->to_vectors;
        functions8 f;
        for (int k = 0; k < functions_of(kind); k++) {
            f.f[k] = v8_fma(v8_load(step[k]), factor, v8_all(x->at_tiles[k][t]));
            v8_store(batch->at_vectors[i][k], f.f[k]);
        }
        batch->pair[i] = (sdm_tile_pair){(uint16_t)place, (uint16_t)(8 * t)};
        v8f out = beyond(kind, &f, x->sum, less, x->most);
        if (kind != SDM_THIN_FACES) {
            v8f d2 = v8_mul(f.f[3], f.f[3]);
            if (kind == SDM_EDGES) d2 = v8_fma(f.f[1], f.f[1], d2);
            if (kind == SDM_CORNERS) {
                const point8 from = p8_add(p8_load((const float(*)[8])job->vector[t].x),
                                           p8_all(x->from[0], x->from[1], x->from[2]));
                d2 = p8_dot(from, from);
            }
            out = v8_max(out, v8_sub(d2, v8_load(b->far2[t])));
        }
        const unsigned mask = ~(unsigned)v8_greater(out, error);
        n = put_lanes(job, batch->vector, n, (uint32_t)(i * SDM_FLOATS(batch->at_vectors[0])),
                      mask & b->wanted[t]);
    }
    return n;
}

#endif
