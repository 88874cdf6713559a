/* Stage 6: chooses the nearest candidate of each voxel of a tile, computes its distance in double
   and writes it. Part of map.inc. */
#pragma once

#include <assert.h>

#include "block.h"
#include "features/feature_distance4.h"

typedef struct tile {
    const sdm_grid_job *job;
    const sdm_candidates *candidates;
    // number of the tile within the block
    unsigned number;
    // first voxel of the tile, and its position in mm
    int64_t first[3];
    double corner[3];
    // mask of the vectors that begin inside the grid
    unsigned vectors;
    // block.error
    float error;
} tile;

/* Results of the 64 voxels of a tile, indexed as by sdm_grid_job.voxel_in_tile. */
typedef struct voxels {
    // number of the nearest feature, SDM_NONE: none known
    uint32_t number[64];
    // squared distance, mm^2
    _Alignas(32) double d2[64];
    // voxels that tile_choose() has already settled: their indices and squared distances, mm^2
    int n_settled;
    uint8_t settled[64];
    double settled_d2[64];
} voxels;

/* Index within the tile of the voxel in a lane of a vector. */
static inline unsigned voxel_index(const sdm_grid_job *job, int vector, int lane)
{
    const unsigned i = job->voxel_in_tile[vector][lane];
    assert(i < 64);
    return i;
}

static inline void voxel_position(const tile *t, unsigned i, double p[3])
{
    for (int a = 0; a < 3; a++) p[a] = t->corner[a] + t->job->tile_voxel[a][i];
}

/* Searches the tree for the nearest triangle of the whole surface, for voxels without a candidate.
   Returns its slot, which is the number of its face, and sets the squared distance. */
static uint32_t nearest_in_tree(const tile *t, const double p[3], double *d2)
{
    const sdm_nearest *n = t->job->surface;
    uint32_t slot = 0;
    double q[3];
    int feature;
    (void)sdm_nearest_find(n, p, INFINITY, &slot, q, &feature);
    *d2 = sdm_nearest_feature(n, p, &slot);
    return slot;
}

/* Returns the number of the feature nearest to the voxel at p, in this lane of vector v (8 * tile +
   vector), and sets its squared distance. Compares the distances in double of all candidates that
   are marked for the lane. Of several equally near candidates the one found first is taken. */
static uint32_t voxel_settle(const tile *t, unsigned v, int lane, const double p[3], double *d2)
{
    const sdm_candidates *c = t->candidates;
    uint32_t best = SDM_NONE;
    *d2 = INFINITY;
    for (uint32_t i = c->last[v]; i != SDM_NONE; i = c->list[i].before) {
        assert(i < c->n);
        if (!(c->list[i].voxels >> lane & 1)) continue;
        const double d = sdm_feature_distance2(t->job->features, t->job->surface->frames,
                                               c->list[i].number, p, *d2);
        if (!(d < *d2 || (d == *d2 && d < INFINITY))) continue;
        // an equal distance replaces the result: the list is read backwards, so the candidate found
        // first is read last
        *d2 = d;
        best = c->list[i].number;
    }
    // Fallback: the culling bounds always leave a candidate; if they do not, search the tree.
    if (best == SDM_NONE && !(t->job->band_mm < INFINITY)) best = nearest_in_tree(t, p, d2);
    return best;
}

/* Sets x->number of all voxels: the candidate that is clearly nearest in float, or else the one
   that is nearest in double. */
static void tile_choose(const tile *t, voxels *x)
{
    const sdm_grid_job *job = t->job;
    const sdm_candidates *c = t->candidates;
    const v8f k = v8_all(ambiguity(t->error));
    const bool banded = job->band_mm < INFINITY;
    for (int v = 0; v < 8; v++) {
        if (!(t->vectors >> v & 1)) {
            for (int i = 0; i < 8; i++) x->number[voxel_index(job, v, i)] = 0;
            continue;
        }
        // clear: the second nearest is farther than the first by more than the errors of both;
        // false for NaN (INFINITY - INFINITY)
        const unsigned at = 8 * t->number + (unsigned)v;
        if (banded && c->last[at] == SDM_NONE) { // all voxels are outside the band
            for (int i = 0; i < 8; i++) {
                x->settled[x->n_settled] = (uint8_t)voxel_index(job, v, i);
                x->number[x->settled[x->n_settled]] = SDM_NONE;
                x->settled_d2[x->n_settled++] = INFINITY;
            }
            continue;
        }
        const v8f first = v8_load(c->first[at]);
        const v8f limit = v8_fma(v8_add(v8_sqrt(first), v8_all(1)), k, first);
        const int clear = v8_greater(v8_load(c->second[at]), limit) & (int)~c->open[at];
        for (int i = 0; i < 8; i++) {
            const uint32_t number = x->number[voxel_index(job, v, i)] = c->number[at][i];
            __builtin_prefetch(&job->features->exact[number]); // for tile_measure()
        }
        // the other voxels: compare all of their candidates in double
        for (int open = 0xff & ~clear; open; open &= open - 1) {
            const int lane = __builtin_ctz((unsigned)open);
            const unsigned i = voxel_index(job, v, lane);
            double p[3];
            voxel_position(t, i, p);
            x->settled[x->n_settled] = (uint8_t)i;
            x->number[i] = voxel_settle(t, at, lane, p, &x->settled_d2[x->n_settled]);
            x->n_settled++;
        }
    }
}

/* Computes x->d2 of all voxels, the squared distances to the features x->number. */
static void tile_measure(const tile *t, voxels *x)
{
    const double(*at)[64] = t->job->tile_voxel;
    const double *c = t->corner;
    uint32_t number[64];
    for (int i = 0; i < 64; i++) number[i] = x->number[i] == SDM_NONE ? 0 : x->number[i];
    for (int i = 0; i < 64; i += 4)
        distances4(t->job->features->exact, &number[i], v4_add(v4_all(c[0]), v4_load(&at[0][i])),
                   v4_add(v4_all(c[1]), v4_load(&at[1][i])),
                   v4_add(v4_all(c[2]), v4_load(&at[2][i])), &x->d2[i]);
    for (int i = 0; i < x->n_settled; i++) x->d2[x->settled[i]] = x->settled_d2[i];
}

/* Sets x->number and x->d2 of a tile that has no candidates, by searches of the tree. */
static void tile_search(const tile *t, voxels *x)
{
    for (unsigned i = 0; i < 64; i++) {
        double p[3];
        voxel_position(t, i, p);
        x->number[i] = nearest_in_tree(t, p, &x->d2[i]);
    }
}

/* Writes n values of a row of voxels that begins at `at` to the blocks that contain them. */
static void row_write_blocks(const sdm_blocks *b, const int64_t at[3], int64_t n, const float *d)
{
    const int64_t row = (at[2] / SDM_BLOCK_SIZE * b->n[1] + at[1] / SDM_BLOCK_SIZE) * b->n[0],
                  in_block = (at[2] % SDM_BLOCK_SIZE * SDM_BLOCK_SIZE + at[1] % SDM_BLOCK_SIZE) *
                             SDM_BLOCK_SIZE;
    for (int64_t i = at[0], end; i < at[0] + n; i = end) {
        end = (i / SDM_BLOCK_SIZE + 1) * SDM_BLOCK_SIZE;
        end = end < at[0] + n ? end : at[0] + n;
        const uint32_t number = b->tile[row + i / SDM_BLOCK_SIZE];
        if (number >= SDM_TILE_INSIDE) continue;
        memcpy(&b->values[number][in_block + i % SDM_BLOCK_SIZE], &d[i - at[0]],
               (size_t)(end - i) * sizeof *d);
    }
}

/* Writes the first size[3] voxels of a tile if all of them are in one block; false if not. */
static bool tile_store_block(const tile *t, const int64_t size[3], const float d[64])
{
    const sdm_blocks *b = t->job->blocks;
    const int64_t *whole = t->job->part[SDM_TILES].size;
    int64_t at[3];
    for (int a = 0; a < 3; a++) {
        at[a] = t->first[a] % SDM_BLOCK_SIZE;
        if (at[a] + size[a] > SDM_BLOCK_SIZE) return false;
    }
    const uint32_t number =
        b->tile[(t->first[2] / SDM_BLOCK_SIZE * b->n[1] + t->first[1] / SDM_BLOCK_SIZE) * b->n[0] +
                t->first[0] / SDM_BLOCK_SIZE];
    if (number >= SDM_TILE_INSIDE) return true;
    for (int64_t z = 0; z < size[2]; z++) {
        for (int64_t y = 0; y < size[1]; y++) {
            float *to =
                &b->values[number]
                          [((at[2] + z) * SDM_BLOCK_SIZE + at[1] + y) * SDM_BLOCK_SIZE + at[0]];
            const float *from = &d[(z * whole[1] + y) * whole[0]];
            if (size[0] == 4) // the usual size: a constant lets the compiler inline memcpy
                memcpy(to, from, 4 * sizeof *d);
            else
                memcpy(to, from, (size_t)size[0] * sizeof *d);
        }
    }
    return true;
}

/* Writes the first size[3] voxels of a tile to the blocks that contain them. A function of its own:
   inlined, it would slow whole maps down. */
static __attribute__((noinline)) void tile_store_blocks(const tile *t, const int64_t size[3],
                                                        const float d[64])
{
    const int64_t *whole = t->job->part[SDM_TILES].size;
    if (tile_store_block(t, size, d)) return;
    for (int64_t z = 0; z < size[2]; z++)
        for (int64_t y = 0; y < size[1]; y++) {
            const int64_t at[3] = {t->first[0], t->first[1] + y, t->first[2] + z};
            row_write_blocks(t->job->blocks, at, size[0], &d[(z * whole[1] + y) * whole[0]]);
        }
}

/* Writes distances (mm) and, if wanted, slots of the voxels of a tile that are inside the grid. */
static inline void tile_store(const tile *t, const float d[64], const uint32_t slot[64])
{
    const sdm_grid_job *job = t->job;
    const int64_t *whole = job->part[SDM_TILES].size;
    // row by row, cut off at the end of the grid
    int64_t size[3];
    for (int a = 0; a < 3; a++)
        size[a] = job->n[a] - t->first[a] < whole[a] ? job->n[a] - t->first[a] : whole[a];
    if (job->blocks) {
        tile_store_blocks(t, size, d);
        return;
    }
    for (int64_t z = 0; z < size[2]; z++)
        for (int64_t y = 0; y < size[1]; y++) {
            const int64_t to =
                ((t->first[2] + z) * job->n[1] + t->first[1] + y) * job->n[0] + t->first[0];
            const int64_t from = (z * whole[1] + y) * whole[0];
            if (size[0] == 4) // the usual size: a constant lets the compiler inline memcpy
                memcpy(&job->values[to], &d[from], 4 * sizeof *d);
            else
                memcpy(&job->values[to], &d[from], (size_t)size[0] * sizeof *d);
            if (job->slot) memcpy(&job->slot[to], &slot[from], (size_t)size[0] * sizeof *slot);
        }
}

/* Writes a tile whose voxels all lie outside the band. */
static __attribute__((noinline)) void tile_write_far(const tile *t)
{
    float d[64];
    uint32_t slot[64];
    for (int i = 0; i < 64; i++) {
        d[i] = (float)t->job->band_mm;
        slot[i] = SDM_NONE;
    }
    tile_store(t, d, slot);
}

/* Writes the distances and the slots of a tile. */
static void tile_write(const tile *t, voxels *x)
{
    const sdm_grid_job *job = t->job;
    float d[64];
    for (int i = 0; i < 64; i++) d[i] = (float)sqrt(x->d2[i]);
    // from features to triangles
    for (int i = 0; i < 64 && job->slot; i++)
        x->number[i] = x->number[i] == SDM_NONE ? SDM_NONE : job->features->owner[x->number[i]];
    if (job->band_mm < INFINITY)
        for (int i = 0; i < 64; i++) {
            if (d[i] < (float)job->band_mm) continue;
            d[i] = (float)job->band_mm;
            x->number[i] = SDM_NONE;
        }
    tile_store(t, d, x->number);
}
