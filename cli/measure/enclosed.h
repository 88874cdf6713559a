/* Parts of a mask that are not joined to the border of their grid. */
#pragma once

#include <stddef.h>

#include "sdm/grid.h"
#include "sdm/status.h"

/* *n = number of voxels of the mask (1; others 0) that the border does not reach through voxels
 * whose six neighbours belong to the mask, too: neither noise nor a wall of one voxel with a hole
 * joins two parts. Voxels beside a voxel that is reached count as reached. Changes the mask.
 * SDM_E_NOMEM. */
sdm_status cli_count_enclosed(const sdm_grid *g, unsigned char *mask, size_t *n, sdm_error *err);
