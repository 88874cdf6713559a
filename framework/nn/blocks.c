/* Blocks of voxels and the copies between map order and block order. */
#include <string.h>

#include "sdm/pod.h"

static size_t along(int64_t n, size_t block) { return ((size_t)n + block - 1) / block; }

size_t sdm_pod_block_count(const sdm_grid *grid, size_t block)
{
    return along(grid->n[0], block) * along(grid->n[1], block) * along(grid->n[2], block);
}

void sdm_pod_blocks(const sdm_grid *grid, size_t block, sdm_pod_block *blocks)
{
    const size_t count[3] = {along(grid->n[0], block), along(grid->n[1], block), along(grid->n[2], block)};
    uint64_t voxel = 0;
    for (size_t b = 0; b < count[0] * count[1] * count[2]; b++) {
        const size_t index[3] = {b % count[0], b / count[0] % count[1], b / count[0] / count[1]};
        sdm_pod_block *k = &blocks[b];
        *k = (sdm_pod_block){.voxel = voxel};
        uint64_t voxels = 1;
        for (int a = 0; a < 3; a++) {
            const size_t at = index[a] * block, rest = (size_t)grid->n[a] - at;
            k->at[a] = (uint32_t)at;
            k->size[a] = (uint32_t)(rest < block ? rest : block);
            voxels *= k->size[a];
        }
        voxel += voxels;
    }
}

// offset of row (y, z) of block k in a map
static size_t row_in_map(const sdm_grid *g, const sdm_pod_block *k, size_t y, size_t z)
{
    return ((k->at[2] + z) * (size_t)g->n[1] + k->at[1] + y) * (size_t)g->n[0] + k->at[0];
}

void sdm_pod_gather(const sdm_grid *grid, const sdm_pod_block *blocks, size_t n_blocks, const float *map,
                    float *blocked)
{
    for (const sdm_pod_block *k = blocks; k < blocks + n_blocks; k++)
        for (size_t z = 0; z < k->size[2]; z++)
            for (size_t y = 0; y < k->size[1]; y++)
                memcpy(blocked + k->voxel + (z * k->size[1] + y) * k->size[0], map + row_in_map(grid, k, y, z),
                       k->size[0] * sizeof *map);
}

void sdm_pod_scatter(const sdm_grid *grid, const sdm_pod_block *blocks, size_t n_blocks, const float *blocked,
                     float *map)
{
    for (const sdm_pod_block *k = blocks; k < blocks + n_blocks; k++)
        for (size_t z = 0; z < k->size[2]; z++)
            for (size_t y = 0; y < k->size[1]; y++)
                memcpy(map + row_in_map(grid, k, y, z), blocked + k->voxel + (z * k->size[1] + y) * k->size[0],
                       k->size[0] * sizeof *map);
}
