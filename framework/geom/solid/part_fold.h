/* Parts whose surface passes through itself so that some of it faces the wrong way. */
#pragma once

#include "mesh/bvh.h"
#include "sdm/internal/part_audit.h"

/* Sets part[i].folded, i < n, of the solid parts of a closed mesh that meet themselves: the share
   of 2000 places, spread over their area, in front of which the winding number of the part is
   negative and that of the mesh is not positive. part_of[triangle]: number of the part; numbers
   beyond n do not count. SDM_E_NOMEM. */
sdm_status sdm_part_folds(const sdm_mesh *m, const sdm_bvh *tree, const uint32_t *part_of,
                          sdm_part *part, size_t n, sdm_error *err);
