/* Do the vertices of two meshes correspond by their numbers? */
#pragma once

#include "sdm/mesh.h"

/* true: both meshes have as many vertices, and the same triangles. */
static inline bool sdm_mesh_same_triangles(const sdm_mesh *a, const sdm_mesh *b)
{
    if (a->n_vert != b->n_vert || a->n_tri != b->n_tri) return false;
    for (size_t i = 0; i < 3 * a->n_tri; i++)
        if (a->tri[i] != b->tri[i]) return false;
    return true;
}
