/* The levels of blocks of a grid, and the copy of a map into block order. */
#include <string.h>

#include "sdm/internal/pod.h"

// count[3] = number of blocks of `edge` voxels along each axis; returns their product.
static size_t blocks_along(const sdm_grid *g, size_t edge, size_t count[3])
{
    for (int a = 0; a < 3; a++) count[a] = ((size_t)g->n[a] + edge - 1) / edge;
    return count[0] * count[1] * count[2];
}

sdm_pod_levels sdm_pod_count(const sdm_grid *grid, size_t block, size_t levels)
{
    sdm_pod_levels l = {0};
    size_t count[3], n;
    do {
        n = blocks_along(grid, block << l.n, count);
        l.first[l.n + 1] = l.first[l.n] + n;
        l.n++;
    } while (l.n < levels && l.n < SDM_POD_MAX_LEVELS && n > 1);
    return l;
}

// the block at index (x, y, z) among those of its level, cut off at the end of the grid
static sdm_pod_block block_at(const sdm_grid *g, size_t edge, const size_t index[3])
{
    sdm_pod_block b = {0};
    for (int a = 0; a < 3; a++) {
        const size_t at = index[a] * edge, rest = (size_t)g->n[a] - at;
        b.at[a] = (uint32_t)at;
        b.size[a] = (uint32_t)(rest < edge ? rest : edge);
    }
    return b;
}

void sdm_pod_blocks(const sdm_grid *grid, size_t block, const sdm_pod_levels *levels,
                    sdm_pod_block *blocks)
{
    // the highest level, x fastest
    size_t level = levels->n - 1, edge = block << level, count[3];
    const size_t n = blocks_along(grid, edge, count);
    sdm_pod_block *b = blocks + levels->first[level];
    for (size_t i = 0; i < n; i++)
        *b++ = block_at(
            grid, edge,
            (const size_t[]){i % count[0], i / count[0] % count[1], i / count[0] / count[1]});

    // each level from the one above: the children of each parent that lie inside the grid
    while (level-- > 0) {
        edge /= 2;
        blocks_along(grid, edge, count);
        sdm_pod_block *child = blocks + levels->first[level];
        for (size_t p = levels->first[level + 1]; p < levels->first[level + 2]; p++) {
            sdm_pod_block *parent = &blocks[p];
            parent->child = (uint32_t)(child - blocks);
            for (size_t i = 0; i < 8; i++) {
                const size_t index[3] = {parent->at[0] / edge + (i & 1),
                                         parent->at[1] / edge + (i >> 1 & 1),
                                         parent->at[2] / edge + (i >> 2)};
                // a child outside the grid does not exist
                if (index[0] >= count[0] || index[1] >= count[1] || index[2] >= count[2]) continue;
                *child++ = block_at(grid, edge, index);
                parent->n_children++;
            }
        }
    }

    // offsets in block order
    for (level = 0; level < levels->n; level++) {
        uint64_t voxel = 0;
        for (size_t i = levels->first[level]; i < levels->first[level + 1]; i++) {
            blocks[i].voxel = voxel;
            voxel += sdm_pod_block_voxels(&blocks[i]);
        }
    }
}

void sdm_pod_number(const sdm_pod_levels *levels, sdm_pod_block *blocks)
{
    for (size_t level = 0; level < levels->n; level++) {
        uint32_t at = 0;
        for (size_t i = levels->first[level]; i < levels->first[level + 1]; i++) {
            blocks[i].coefficient = at;
            at += blocks[i].rank;
        }
    }
}

size_t sdm_pod_outputs(const sdm_pod_block *blocks, size_t b)
{
    const sdm_pod_block *k = &blocks[b];
    if (!k->n_children) return sdm_pod_block_voxels(k);
    const sdm_pod_block *first = &blocks[k->child], *last = first + k->n_children - 1;
    return last->coefficient + last->rank - first->coefficient;
}

// index in a map of the first voxel of row (y, z) of block k
static size_t row_in_map(const sdm_grid *g, const sdm_pod_block *k, size_t y, size_t z)
{
    return ((k->at[2] + z) * (size_t)g->n[1] + k->at[1] + y) * (size_t)g->n[0] + k->at[0];
}

void sdm_pod_gather(const sdm_grid *grid, const sdm_pod_block *blocks, size_t n_blocks,
                    const float *map, float *blocked)
{
    for (const sdm_pod_block *k = blocks; k < blocks + n_blocks; k++)
        for (size_t z = 0; z < k->size[2]; z++)
            for (size_t y = 0; y < k->size[1]; y++)
                memcpy(blocked + k->voxel + (z * k->size[1] + y) * k->size[0],
                       map + row_in_map(grid, k, y, z), k->size[0] * sizeof *map);
}
