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

/* Results of the 64 voxels of a tile, [vector][lane]. */
typedef struct voxels {
    // number of the nearest feature, SDM_NONE: the voxel lies outside the band
    uint32_t number[8][8];
    // distance, mm
    _Alignas(32) float distance[8][8];
} voxels;

static inline void voxel_position(const tile *t, int vector, int lane, double p[3])
{
    for (int a = 0; a < 3; a++) p[a] = t->corner[a] + t->job->voxel_mm[a][vector][lane];
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

/* Distances of the eight voxels of a vector, each from its own feature. */
static inline void vector_distances(const tile *t, int v, const uint32_t number[8], float out[8])
{
    const sdm_feature *exact = t->job->features->exact;
    const double(*at)[8][8] = t->job->voxel_mm;
    const bool one = v8_uniform(v8_load_i(number));
    _Alignas(32) double d[8];
    for (int i = 0; i < 8; i += 4) {
        const v4d x = v4_add(v4_all(t->corner[0]), v4_load(&at[0][v][i])),
                  y = v4_add(v4_all(t->corner[1]), v4_load(&at[1][v][i])),
                  z = v4_add(v4_all(t->corner[2]), v4_load(&at[2][v][i]));
        if (one)
            v4_store(&d[i], distances4_from(&exact[number[0]], x, y, z));
        else
            v4_store(&d[i], v4_sqrt(distances4(exact, &number[i], x, y, z)));
    }
    for (int i = 0; i < 8; i++) out[i] = (float)d[i];
}

/* Finds the nearest features of the voxels of a vector, and their distances: the candidate that is
   clearly nearest in float, or else the one that is nearest in double. */
static void vector_fill(const tile *t, int v, voxels *x)
{
    const sdm_grid_job *job = t->job;
    const sdm_candidates *c = t->candidates;
    const unsigned at = 8 * t->number + (unsigned)v;
    // clear: the second nearest is farther than the first by more than the errors of both; false
    // for NaN (INFINITY - INFINITY)
    const v8f first = v8_load(c->first[at]), k = v8_all(ambiguity(t->error));
    const v8f limit = v8_fma(v8_add(v8_sqrt(first), v8_all(1)), k, first);
    const int clear = v8_greater(v8_load(c->second[at]), limit) & (int)~c->open[at];
    memcpy(x->number[v], c->number[at], sizeof x->number[v]);
    vector_distances(t, v, c->number[at], x->distance[v]);
    // the other voxels: compare all of their candidates in double
    for (int open = 0xff & ~clear; open; open &= open - 1) {
        const int lane = __builtin_ctz((unsigned)open);
        double p[3], d2;
        voxel_position(t, v, lane, p);
        x->number[v][lane] = voxel_settle(t, at, lane, p, &d2);
        x->distance[v][lane] = (float)sqrt(d2);
    }
    if (job->band_mm < INFINITY)
        v8_store(x->distance[v], v8_min(v8_load(x->distance[v]), v8_all((float)job->band_mm)));
}

/* Sets the voxels of a vector outside the band. */
static void vector_fill_far(const sdm_grid_job *job, int v, voxels *x)
{
    for (int i = 0; i < 8; i++) {
        x->distance[v][i] = (float)job->band_mm;
        x->number[v][i] = SDM_NONE;
    }
}

/* Sets the voxels of a tile without candidates: by searches of the tree. */
static void tile_search(const tile *t, voxels *x)
{
    for (int v = 0; v < 8; v++)
        for (int i = 0; i < 8; i++) {
            double p[3], d2;
            voxel_position(t, v, i, p);
            x->number[v][i] = nearest_in_tree(t, p, &d2);
            x->distance[v][i] = (float)sqrt(d2);
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

/* Writes the first size[3] voxels of a tile to the blocks that contain them. */
static void tile_store_blocks(const tile *t, const int64_t size[3], const float d[64])
{
    const int64_t *whole = t->job->part[SDM_TILES].size;
    for (int64_t z = 0; z < size[2]; z++)
        for (int64_t y = 0; y < size[1]; y++) {
            const int64_t at[3] = {t->first[0], t->first[1] + y, t->first[2] + z};
            row_write_blocks(t->job->blocks, at, size[0], &d[(z * whole[1] + y) * whole[0]]);
        }
}

/* Writes the voxels of a tile that are inside the grid row by row, and their slots if wanted. */
static __attribute__((noinline)) void tile_store_rows(const tile *t, const voxels *x)
{
    const sdm_grid_job *job = t->job;
    const int64_t *whole = job->part[SDM_TILES].size;
    float d[64];
    uint32_t slot[64];
    int64_t size[3];
    const bool banded = job->band_mm < INFINITY;
    for (int v = 0; v < 8; v++) {
        if (!(t->vectors >> v & 1)) continue;
        for (int i = 0; i < 8; i++) {
            const unsigned at = job->voxel_in_tile[v][i];
            d[at] = x->distance[v][i];
            if (!job->slot) continue;
            const bool far = banded && !(d[at] < (float)job->band_mm);
            slot[at] = far ? SDM_NONE : job->features->owner[x->number[v][i]];
        }
    }
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
            memcpy(&job->values[to], &d[from], (size_t)size[0] * sizeof *d);
            if (job->slot) memcpy(&job->slot[to], &slot[from], (size_t)size[0] * sizeof *slot);
        }
}

/* Where tile_store() may write the value of the first voxel of a tile, and those of the others by
   sdm_grid_job.voxel_store; NULL: the tile is cut off by the end of the grid or of a block, its
   block is not wanted, slots are wanted, or its values do not lie in pairs. */
static inline float *tile_target(const tile *t)
{
    const sdm_grid_job *job = t->job;
    const sdm_blocks *b = job->blocks;
    const int64_t *first = t->first, s = SDM_BLOCK_SIZE;
    if (!job->paired || job->slot) return NULL;
    for (int a = 0; a < 3; a++) {
        const int64_t end = first[a] + job->part[SDM_TILES].size[a];
        if (end > job->n[a]) return NULL;
        if (b && first[a] % s > s - job->part[SDM_TILES].size[a]) return NULL;
    }
    if (!b) return &job->values[(first[2] * job->n[1] + first[1]) * job->n[0] + first[0]];
    const uint32_t number =
        b->tile[(first[2] / s * b->n[1] + first[1] / s) * b->n[0] + first[0] / s];
    if (number >= SDM_TILE_INSIDE) return NULL;
    return &b->values[number][(first[2] % s * s + first[1] % s) * s + first[0] % s];
}

/* Writes the voxels of a tile that are inside the grid. */
static inline void tile_store(const tile *t, const voxels *x)
{
    float *to = tile_target(t);
    if (!to) {
        tile_store_rows(t, x);
        return;
    }
    for (int v = 0; v < 8; v++)
        for (int i = 0; i < 8; i += 2)
            memcpy(&to[t->job->voxel_store[v][i]], &x->distance[v][i], 2 * sizeof(float));
}
