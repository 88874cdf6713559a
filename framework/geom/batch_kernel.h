/* A batch of features of one kind against the tiles of a block, and its vectors. Part of the map kernels. */
#ifndef SDM_GEOM_BATCH_KERNEL_H
#define SDM_GEOM_BATCH_KERNEL_H

#include "groups_kernel.h"

/* Functions of the face or edge in a lane of a group at the middles of the tiles, and what they change by from there on. Returns the tiles
   that meet its region. How far it is its cluster was asked: of those that are left hardly any is too far from a tile or vector. */
SDM_FOR_KIND unsigned place_functions(const block *b, int kind, point8 to_voxel, const sdm_met_group *m, uint32_t lane,
                                      sdm_block_feature *x, float to_vectors[4][8])
{
    const sdm_grid_job *job = b->job;
    const float *g = &m->group->g[0][0][lane], *at = &m->at_block[0][lane];
    functions8 tile;
    x->number = m->number + lane;
    x->most_at_vector = &m->most_at_vector[0][lane];
    for (int k = 0; k < 2 && kind == SDM_EDGES; k++) x->most[k] = m->group->most[k][lane];
    for (int k = 0; k < 4; k++) {
        const v8f step = p8_dot(p8_all(g[24 * k], g[24 * k + 8], g[24 * k + 16]), to_voxel);
        v8_store(x->to_voxels[k], step);
        tile.f[k] = v8_fma(step, v8_all(4), v8_all(at[8 * k]));
    }
    for (int k = 0; k < 4 && !job->alike; k++) {
        const point8 gradient = p8_all(g[24 * k], g[24 * k + 8], g[24 * k + 16]);
        v8_store(to_vectors[k], p8_dot(gradient, p8_load((const float(*)[8])job->part[SDM_TO_VECTORS].middle.x)));
        tile.f[k] =
            p8_linear(gradient, p8_load((const float(*)[8])job->part[SDM_TO_TILES].middle.x), v8_all(at[8 * k]));
    }
    for (int k = 0; k < 4; k++) v8_store(x->at_tiles[k], tile.f[k]);
    return m->mask & ~(unsigned)v8_greater(beyond(kind, &tile, &m->most_at_tile[0][lane]), v8_all(0));
}

static inline unsigned place_corner(const block *b, const sdm_cluster_ref *c, sdm_block_feature *x)
{
    const sdm_grid_job *job = b->job;
    const sdm_corner_row *k = &job->features->corner[x->number - job->features->corner_base];
    for (int a = 0; a < 3; a++) x->at[a] = k->at[a] - c->shift[a];
    const point8 p = p8_load((const float(*)[8])job->part[SDM_TO_TILES].middle.x);
    const point8 from = p8_sub(p, p8_all(x->at[0], x->at[1], x->at[2]));
    return c->mask & ~(unsigned)v8_greater(
                         beyond_corner_part(&job->part[SDM_TO_TILES], job->aligned, k, b->error, from), v8_all(0));
}

/* Takes the features that wait into the batch and lists the tiles that they meet; returns how many. */
SDM_FOR_KIND size_t hit_tiles(block *b, int kind)
{
    const sdm_pending *p = &b->s->pending[kind];
    sdm_batch *batch = b->s->batch;
    const point8 to_voxel = p8_load((const float(*)[8])b->job->to_voxel.x);
    unsigned met = 0;
    size_t n = 0;
    for (size_t i = 0; i < p->n; i++) {
        sdm_block_feature *x = &batch->feature[i];
        unsigned mask;
        if (kind == SDM_CORNERS) {
            x->number = p->corner[i];
            mask = place_corner(b, &b->s->cluster[p->cluster[i]], x);
        } else {
            mask = place_functions(b, kind, to_voxel, &p->met[p->feature[i] / 8], p->feature[i] % 8, x,
                                   batch->to_vectors[i]);
        }
        met |= mask;
        n = put_lanes(b->job, batch->tile, n, (uint32_t)(32 * i), mask);
    }
    b->met |= met;
    return n;
}

/* Vectors of a tile that meet the region of a face or edge. */
SDM_FOR_KIND unsigned vectors_met(const block *b, int kind, const sdm_block_feature *x, const float to_vectors[4][8],
                                  unsigned t, float out[4][8][8])
{
    const bool alike = b->job->alike;
    const float(*step)[8] = alike ? (const float(*)[8])x->to_voxels : to_vectors;
    const v8f factor = v8_all(alike ? 2 : 1);
    functions8 f;
    for (int k = 0; k < 4; k++) {
        f.f[k] = v8_fma(v8_load(step[k]), factor, v8_all(x->at_tiles[k][t]));
        v8_store(out[k][t], f.f[k]);
    }
    return ~(unsigned)v8_greater(beyond(kind, &f, x->most_at_vector), v8_all(0));
}

static inline unsigned vectors_met_by_corner(const block *b, const sdm_block_feature *x, unsigned t)
{
    const sdm_grid_job *job = b->job;
    const sdm_corner_row *k = &job->features->corner[x->number - job->features->corner_base];
    const point8 p = p8_load((const float(*)[8])job->vector[t].x);
    const point8 from = p8_sub(p, p8_all(x->at[0], x->at[1], x->at[2]));
    return ~(unsigned)v8_greater(beyond_corner_part(&job->part[SDM_TO_VECTORS], job->aligned, k, b->error, from),
                                 v8_all(0));
}

/* Lists the vectors that meet the batch's features; returns how many. */
SDM_FOR_KIND size_t hit_vectors(const block *b, int kind, size_t n_tile)
{
    sdm_batch *batch = b->s->batch;
    size_t n = 0;
    for (size_t i = 0; i < n_tile; i++) {
        const uint32_t tile = batch->tile[i], t = tile % 32;
        const sdm_block_feature *x = &batch->feature[tile / 32];
        const unsigned mask = kind == SDM_CORNERS
                                  ? vectors_met_by_corner(b, x, t)
                                  : vectors_met(b, kind, x, (const float(*)[8])batch->to_vectors[tile / 32], t,
                                                batch->at_vectors[tile / 32]);
        n = put_lanes(b->job, batch->vector, n, 8 * tile, mask & b->wanted[t]);
    }
    return n;
}

#endif
