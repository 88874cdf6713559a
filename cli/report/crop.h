/* Blocks of voxels: a box of a grid, for cropping maps and images. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/mesh.h"

/* A block of voxels: indices from[a] .. from[a] + n[a] - 1 along axis a; empty when an
 * n[a] is 0. */
typedef struct cli_block {
    int64_t from[3], n[3];
} cli_block;

/* The bounding box of the vertices (world), enlarged by `pad` mm on every side and clipped to the
 * grid. Empty when the box lies outside of the grid. */
cli_block cli_block_of_mesh(const sdm_grid *g, const sdm_mesh *m, double pad);

/* The bounding box of the voxels with a value above 0, enlarged by `pad` mm on every side and
 * clipped to the grid. Empty without such a voxel. */
cli_block cli_block_of_labels(const sdm_grid *g, const float *values, double pad);

/* The smallest block that holds both; an empty block does not count. */
cli_block cli_block_union(const cli_block *a, const cli_block *b);

bool cli_block_is_empty(const cli_block *b);

/* The grid of the block's voxels. */
sdm_grid cli_block_grid(const sdm_grid *g, const cli_block *b);

/* out[n[2]][n[1]][n[0]] = the values of the block in values[g->n[2]][g->n[1]][g->n[0]]. */
void cli_block_copy(const sdm_grid *g, const float *values, const cli_block *b, float *out);
