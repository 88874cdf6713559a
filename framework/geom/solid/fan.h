/* Pairs of triangles that share a vertex: which of them may meet elsewhere. */
#ifndef SDM_GEOM_FAN_H
#define SDM_GEOM_FAN_H

#include "memory/budget.h"
#include "mesh/facet.h"
#include "mesh/topology.h"

/* Bytes that a visit takes in passing where vertices that make up no disc are few. */
size_t sdm_fans_bytes(size_t n_vert);

/* Calls visit(user, i, j, shared) for the pairs i < j of triangles with 1, 2 or 3 common vertices,
   but for those around a vertex whose triangles make up a disc that is seen from one side without
   overlap; stops at the first status that is not SDM_OK and returns it. Triangles with a repeated
   vertex are left out. budget: asked whether to stop; may be NULL. */
sdm_status sdm_fans_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_facet *facets,
                          double tolerance, sdm_arena *arena,
                          sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                          void *user, const sdm_budget *budget, sdm_error *err);

#endif
