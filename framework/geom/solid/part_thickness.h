/* How thick the parts of a closed mesh are. */
#pragma once

#include "mesh/bvh.h"
#include "sdm/internal/part_audit.h"

/* Measures the thickness of parts: sets parts[i].thick and parts[i].doubled, i < n, where the state
 * is SDM_PART_SOLID. m: a closed mesh with the orientation of the engine; tree: of m;
 * part_of[n_tri]: index of the part of each triangle, or one of at least n. SDM_E_NOMEM. */
sdm_status sdm_part_thickness(const sdm_mesh *m, const sdm_bvh *tree, const uint32_t *part_of,
                              sdm_part *parts, size_t n, sdm_error *err);
