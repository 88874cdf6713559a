/* Meshes that grow: capacity increases geometrically, not vertex by vertex. */
#include "sdm/internal/builder.h"

#include <string.h>

/* Enlarges the arrays to at least the given counts; an array that is too small gets 1.5 times the
   needed size. */
static sdm_status builder_reserve(sdm_builder *b, size_t need_vert, size_t need_tri, sdm_error *err)
{
    size_t n_vert = b->mesh->n_vert, n_tri = b->mesh->n_tri;
    if (need_vert > n_vert) n_vert = need_vert < 64 ? 64 : need_vert + need_vert / 2;
    if (need_tri > n_tri) n_tri = need_tri < 64 ? 64 : need_tri + need_tri / 2;
    return sdm_mesh_reserve(b->mesh, n_vert, n_tri, err);
}

sdm_status sdm_builder_vertex(sdm_builder *b, const double x[3], sdm_error *err)
{
    if (b->n_vert >= b->mesh->n_vert) {
        const sdm_status s = builder_reserve(b, b->n_vert + 1, b->n_tri, err);
        if (s) return s;
    }
    memcpy(b->mesh->vert + 3 * b->n_vert++, x, 3 * sizeof *x);
    return SDM_OK;
}

sdm_status sdm_builder_triangle(sdm_builder *b, uint32_t v0, uint32_t v1, uint32_t v2,
                                sdm_error *err)
{
    if (b->n_tri >= b->mesh->n_tri) {
        const sdm_status s = builder_reserve(b, b->n_vert, b->n_tri + 1, err);
        if (s) return s;
    }
    uint32_t *t = b->mesh->tri + 3 * b->n_tri++;
    t[0] = v0;
    t[1] = v1;
    t[2] = v2;
    return SDM_OK;
}

sdm_status sdm_builder_corner(sdm_builder *b, sdm_fan *fan, uint32_t vertex, sdm_error *err)
{
    if (fan->n++ == 0) fan->first = vertex;
    const uint32_t before = fan->last;
    fan->last = vertex;
    return fan->n < 3 ? SDM_OK : sdm_builder_triangle(b, fan->first, before, vertex, err);
}

sdm_status sdm_builder_finish(sdm_builder *b, sdm_error *err)
{
    return sdm_mesh_reserve(b->mesh, b->n_vert, b->n_tri, err);
}
