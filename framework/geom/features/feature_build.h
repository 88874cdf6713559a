/* Builds the features of a surface; see surface_features.h. */
#pragma once

#include "surface_features.h"

/* Builds the features of mesh m with topology topo and tree `tree`, and frames[slot] of all
   triangles tree->order[slot]. f must be zeroed. The results are taken from the low end of the
   arena, scratch memory from its high end; the scratch is released before return. SDM_E_NOMEM where
   memory, the memory limit or 31-bit feature numbers do not suffice. */
sdm_status sdm_features_build(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                              sdm_arena *arena, sdm_frame *frames, sdm_features *f, sdm_error *err);
