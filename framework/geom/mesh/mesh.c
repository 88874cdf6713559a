/* Storage of triangle meshes. */
#include "sdm/mesh.h"

#include <string.h>

#include "sdm/internal/heap.h"

#define MESH_MAX ((size_t)1 << 31)

sdm_status sdm_mesh_reserve(sdm_mesh *m, size_t n_vert, size_t n_tri, sdm_error *err)
{
    if (n_vert > MESH_MAX || n_tri > MESH_MAX)
        return sdm_fail(err, SDM_E_MESH,
                        "mesh of %zu vertices and %zu triangles, at most %zu of each", n_vert,
                        n_tri, MESH_MAX);
    if (n_vert > m->cap_vert || !m->vert) {
        const sdm_status s = sdm_grow((void **)&m->vert, 3 * m->n_vert, 3 * n_vert, sizeof *m->vert,
                                      "mesh vertices", err);
        if (s) return s;
        m->cap_vert = n_vert;
    }
    if (n_tri > m->cap_tri || !m->tri) {
        const sdm_status s = sdm_grow((void **)&m->tri, 3 * m->n_tri, 3 * n_tri, sizeof *m->tri,
                                      "mesh triangles", err);
        if (s) return s;
        m->cap_tri = n_tri;
    }
    m->n_vert = n_vert;
    m->n_tri = n_tri;
    return SDM_OK;
}

sdm_status sdm_mesh_copy(const sdm_mesh *from, sdm_mesh *to, sdm_error *err)
{
    if (from == to) return SDM_OK;
    const sdm_status s = sdm_mesh_reserve(to, from->n_vert, from->n_tri, err);
    if (s) return s;
    if (from->n_vert) memcpy(to->vert, from->vert, 3 * from->n_vert * sizeof *to->vert);
    if (from->n_tri) memcpy(to->tri, from->tri, 3 * from->n_tri * sizeof *to->tri);
    return SDM_OK;
}

void sdm_mesh_dispose(sdm_mesh *m)
{
    if (!m) return;
    sdm_free(m->vert);
    sdm_free(m->tri);
    *m = (sdm_mesh){0};
}
