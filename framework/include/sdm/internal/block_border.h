/* Whether a narrow-band map in blocks reaches the border of its grid. */
#pragma once

#include <stdbool.h>

#include "sdm/blocks.h"
#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Does a voxel on the border of the grid lie within the band or inside? Then the surface or its
 * band may leave the grid. [any thread] */
SDM_INTERNAL_API bool sdm_blocks_reach_border(const sdm_blocks *b);

#ifdef __cplusplus
}
#endif
