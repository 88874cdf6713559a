/* The bounding box of a mesh. */
#pragma once

#include "sdm/internal/box.h"
#include "sdm/mesh.h"

/* Extends the box to the triangles of the mesh. Vertices of no triangle do not count: they are no
 * part of the surface. */
static inline void sdm_box_add_mesh(sdm_box *b, const sdm_mesh *m)
{
    for (size_t i = 0; i < 3 * m->n_tri; i++) sdm_box_add(b, m->vert + 3 * (size_t)m->tri[i]);
}
