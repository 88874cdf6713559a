/* Candidate pairs of triangles that share a vertex and may also meet elsewhere. */
#ifndef SDM_GEOM_FAN_H
#define SDM_GEOM_FAN_H

#include "mesh/facet.h"
#include "mesh/topology.h"

/* Calls visit(user, i, j, shared) for the pairs i < j of triangles with 1, 2 or 3 common (welded)
 * vertices, except those with a common vertex whose fan is provably a disc: its triangles then meet
 * in common vertices and edges only. Triangles in which a vertex occurs twice are left out.
 * tolerance: lengths up to this, mm, count as 0. Scratch memory is taken from the high end of the
 * arena and released. Stops at the first status of visit() other than SDM_OK and returns it;
 * SDM_E_NOMEM, SDM_E_CANCELLED as the arena's options say. */
sdm_status sdm_fans_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_facet *facets,
                          double tolerance, sdm_arena *arena,
                          sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                          void *user, sdm_error *err);

#endif
