/* Parts of a grid and of the maps on it. */
#ifndef CLI_CROP_H
#define CLI_CROP_H

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/mesh.h"

/* A block of voxels, from index `from` on, n of them along each axis. */
typedef struct cli_block {
    int64_t from[3], n[3];
} cli_block;

/* The voxels around the vertices of a mesh, `pad` mm more on every side, as far as the grid goes; n
   is 0 along an axis when they are all outside. */
cli_block cli_block_of_mesh(const sdm_grid *g, const sdm_mesh *m, double pad);

/* The voxels whose value is above 0, `pad` mm more on every side. n is 0 without one. */
cli_block cli_block_of_labels(const sdm_grid *g, const float *values, double pad);

/* The least block that holds both; one that is empty does not count. */
cli_block cli_block_union(const cli_block *a, const cli_block *b);

bool cli_block_is_empty(const cli_block *b);
sdm_grid cli_block_grid(const sdm_grid *g, const cli_block *b);

/* out[b->n] = values of the block. */
void cli_block_copy(const sdm_grid *g, const float *values, const cli_block *b, float *out);

#endif
