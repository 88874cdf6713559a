/* Memory of a narrow-band map in blocks. */
#include "sdm/blocks.h"

#include <string.h>

#include "sdm/internal/block_border.h"
#include "sdm/memory.h"

/* Is a value of block i, at a voxel of the border of the grid, less than the band? */
static bool block_reaches_border(const sdm_blocks *b, size_t i)
{
    for (int v = 0; v < SDM_BLOCK_VOXELS; v++) {
        const int64_t at[3] = {b->first[i][0] + v % SDM_BLOCK_SIZE,
                               b->first[i][1] + v / SDM_BLOCK_SIZE % SDM_BLOCK_SIZE,
                               b->first[i][2] + v / SDM_BLOCK_SIZE / SDM_BLOCK_SIZE};
        bool border = false;
        for (int a = 0; a < 3; a++) border = border || at[a] == 0 || at[a] == b->grid.n[a] - 1;
        // values beyond the grid are those of the band
        if (border && b->values[i][v] < (float)b->band_mm) return true;
    }
    return false;
}

bool sdm_blocks_reach_border(const sdm_blocks *b)
{
    for (int64_t k = 0; k < b->n[2]; k++)
        for (int64_t j = 0; j < b->n[1]; j++)
            for (int64_t i = 0; i < b->n[0]; i++) {
                const uint32_t tile = b->tile[(k * b->n[1] + j) * b->n[0] + i];
                const int64_t at[3] = {i, j, k};
                bool border = false;
                for (int a = 0; a < 3; a++) border = border || at[a] == 0 || at[a] == b->n[a] - 1;
                if (!border || tile == SDM_TILE_OUTSIDE) continue;
                if (tile == SDM_TILE_INSIDE || block_reaches_border(b, tile)) return true;
            }
    return false;
}

void sdm_blocks_dispose(sdm_blocks *b)
{
    sdm_free(b->tile);
    sdm_free(b->first);
    sdm_free(b->values);
    memset(b, 0, sizeof *b);
}
