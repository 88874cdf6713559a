/* The pieces of the inside of a map: sets of voxels that are connected through their faces. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

typedef struct sdm_piece {
    /* the first and the last index of its voxels along each axis */
    int64_t low[3], high[3];
    int64_t voxels;
} sdm_piece;

/* Finds the pieces of the negative values of map[n[2]][n[1]][n[0]]: *out[*count], in the order of
 * their first voxels. Pieces with less than a thousandth of all voxels inside are left out: they
 * are specks of a map that is not exact. The caller frees *out with sdm_free(). SDM_E_NOMEM; *out
 * is then NULL. [any thread] */
sdm_status sdm_pieces_find(const int64_t n[3], const float *map, sdm_piece **out, size_t *count,
                           sdm_error *err);
