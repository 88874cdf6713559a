/* Signs of a narrow-band map in blocks, from the crossings of rows of voxels. */
#include <string.h>

#include "sign_rows.h"

#include "sign.h"

typedef struct blocks_job {
    const sdm_rows *rows;
    sdm_blocks *blocks;
} blocks_job;

/* Negates the elements begin ... end - 1 of a row of a block, which may lie outside of it. Without
   branches, because the lengths are unpredictable. */
static void values_flip(float row[SDM_BLOCK_SIZE], int64_t begin, int64_t end)
{
    uint32_t bits[SDM_BLOCK_SIZE];
    const int32_t from = begin > 0 ? (int32_t)begin : 0,
                  to = end < SDM_BLOCK_SIZE ? (int32_t)end : SDM_BLOCK_SIZE;
    memcpy(bits, row, sizeof bits);
    for (int32_t i = 0; i < SDM_BLOCK_SIZE; i++) bits[i] ^= i >= from && i < to ? 0x80000000u : 0;
    memcpy(row, bits, sizeof bits);
}

/* Signs of the voxels of one row, of the tiles from tile[0] on: negates values of blocks; where
   `corner` is set, the row is the first one of its tiles and sets the signs of those without
   block. */
static void row_flip(const blocks_job *job, size_t row, uint32_t *tile, int64_t in_block,
                     bool corner)
{
    sdm_blocks *b = job->blocks;
    for (sdm_row_span u = sdm_row_spans(job->rows, row); sdm_row_span_next(&u);) {
        if (u.winding < 1) continue;
        for (int64_t i = u.begin / SDM_BLOCK_SIZE; i * SDM_BLOCK_SIZE < u.end; i++) {
            const int64_t first = i * SDM_BLOCK_SIZE;
            if (tile[i] >= SDM_TILE_INSIDE) {
                if (corner && first >= u.begin) tile[i] = SDM_TILE_INSIDE;
                continue;
            }
            values_flip(&b->values[tile[i]][in_block], u.begin - first, u.end - first);
        }
    }
}

static void tile_flip(void *user, const sdm_row_tile *t, const int32_t *base)
{
    const blocks_job *job = user;
    const sdm_blocks *b = job->blocks;
    const int64_t s = SDM_BLOCK_SIZE;
    (void)base; // closed meshes have none
    for (int64_t k = t->k0; k < t->k1; k++)
        for (int64_t j = t->j0; j < t->j1; j++)
            row_flip(job, (size_t)(k * b->grid.n[1] + j),
                     &b->tile[(k / s * b->n[1] + j / s) * b->n[0]], (k % s * s + j % s) * s,
                     j % s == 0 && k % s == 0);
}

sdm_status sdm_sign_blocks(const sdm_sign *s, const sdm_exact_opts *opts, sdm_blocks *b,
                           sdm_error *err)
{
    sdm_sign_rows rows = {0};
    blocks_job job = {&rows.rows, b};
    sdm_status st =
        sdm_sign_rows_build(s->solid, NULL, &b->grid, (const int[3]){0, 1, 2}, opts, &rows, err);
    if (!st) st = sdm_sign_tiles(&rows, b->grid.n[1], b->grid.n[2], opts, tile_flip, &job, err);
    sdm_rows_dispose(&rows.rows);
    return st;
}
