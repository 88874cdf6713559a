/* Finds pairs of triangles without a common vertex that may meet, because their boxes overlap. */
#pragma once

#include "mesh/bvh.h"
#include "mesh/topology.h"

/* Calls visit(user, i, j) once for every pair of triangles (indices in the mesh, i < j or i > j)
 * that share no welded vertex and whose bounding boxes, enlarged by `slack` mm on each side,
 * overlap; some pairs without a common vertex whose boxes do not quite overlap may be among them.
 * Scratch memory is taken from the high end of the arena and released. Stops at the first status of
 * visit() other than SDM_OK and returns it; also SDM_E_NOMEM (memory or memory_limit) and
 * SDM_E_CANCELLED, by the options of the arena. */
sdm_status sdm_pairs_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                           double slack, sdm_arena *arena,
                           sdm_status (*visit)(void *user, uint32_t i, uint32_t j), void *user,
                           sdm_error *err);
