/* Pairs of triangles that may meet: those whose boxes overlap. */
#ifndef SDM_GEOM_PAIRS_H
#define SDM_GEOM_PAIRS_H

#include "memory/budget.h"
#include "mesh/bvh.h"
#include "mesh/topology.h"

/* Bytes that a visit takes in passing. */
size_t sdm_pairs_bytes(size_t n_vert, const sdm_bvh *tree);

/* Calls visit(user, i, j) for every pair of triangles (mesh indices) that share no vertex and whose
   boxes, made larger by `slack`, overlap; stops at the first status that is not SDM_OK and returns
   it. budget: asked whether to stop; may be NULL. */
sdm_status sdm_pairs_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                           double slack, sdm_arena *arena,
                           sdm_status (*visit)(void *user, uint32_t i, uint32_t j), void *user,
                           const sdm_budget *budget, sdm_error *err);

#endif
