/* Builds a mesh vertex by vertex and polygon by polygon when the counts are not known in advance.
 */
#pragma once

#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A mesh under construction. n_vert and n_tri are the counts filled so far; mesh->n_vert and
 * mesh->n_tri are capacities until sdm_builder_finish(). */
typedef struct sdm_builder {
    const char *path; /* file name for messages of the callers */
    sdm_mesh *mesh;
    size_t n_vert, n_tri;
} sdm_builder;

/* Append a vertex or a triangle; the arrays grow geometrically. sdm_builder_finish() sets the
 * counts of the mesh. Errors as sdm_mesh_reserve(). */
sdm_status sdm_builder_vertex(sdm_builder *b, const double x[3], sdm_error *err);
sdm_status sdm_builder_triangle(sdm_builder *b, uint32_t v0, uint32_t v1, uint32_t v2,
                                sdm_error *err);
sdm_status sdm_builder_finish(sdm_builder *b, sdm_error *err);

/* A polygon that is triangulated as a fan around its first corner. Zero-initialise for each
 * polygon, then call sdm_builder_corner() with the vertex index of each corner in turn. */
typedef struct sdm_fan {
    size_t n;
    uint32_t first, last;
} sdm_fan;
sdm_status sdm_builder_corner(sdm_builder *b, sdm_fan *fan, uint32_t vertex, sdm_error *err);

#ifdef __cplusplus
}
#endif
