/* Finds pairs of triangles that share a vertex and may also meet elsewhere. The fan of a vertex is
 * the set of triangles around it. */
#pragma once

#include "mesh/facet.h"
#include "mesh/topology.h"

/* Calls visit(user, i, j, shared) for the pairs i < j of triangles with 1, 2 or 3 common (welded)
 * vertices, except pairs with a common vertex whose fan is provably a disc: the triangles of a disc
 * meet in common vertices and edges only. Triangles in which a vertex occurs twice are left out.
 * tolerance: lengths up to this, mm, count as 0. Scratch memory is taken from the high end of the
 * arena and released. Stops at the first status of visit() other than SDM_OK and returns it; also
 * SDM_E_NOMEM (memory or memory_limit) and SDM_E_CANCELLED, by the options of the arena. */
sdm_status sdm_fans_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_facet *facets,
                          double tolerance, sdm_arena *arena,
                          sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                          void *user, sdm_error *err);
