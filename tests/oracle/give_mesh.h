/* The last lines of mesh() of a shape that is written as a mesh. */
#ifndef SDM_TEST_GIVE_MESH_H
#define SDM_TEST_GIVE_MESH_H

#include <string.h>

#include "sdm/mesh.h"
#include "sdm/shape.h"

/* Copies *m to the arrays of the host, and disposes of it. Returns what mesh() returns. */
static inline int give_mesh(const sdm_host *host, sdm_mesh_out *out, sdm_mesh *m)
{
    const int failed = host->reserve(host, out, m->n_vert, m->n_tri);
    if (!failed) memcpy(out->vert, m->vert, 3 * m->n_vert * sizeof *m->vert);
    if (!failed) memcpy(out->tri, m->tri, 3 * m->n_tri * sizeof *m->tri);
    sdm_mesh_dispose(m);
    return failed;
}

#endif
