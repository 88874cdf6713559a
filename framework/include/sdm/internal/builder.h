/* A mesh that grows vertex by vertex and polygon by polygon, for code that does not know the counts
 * beforehand. */
#ifndef SDM_INTERNAL_BUILDER_H
#define SDM_INTERNAL_BUILDER_H

#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A mesh under construction: n_vert and n_tri say what is filled, the mesh's own counts what there
 * is room for. */
typedef struct sdm_builder {
    const char *path; /* for messages */
    sdm_mesh *mesh;
    size_t n_vert, n_tri;
} sdm_builder;

/* Both grow geometrically; sdm_builder_finish() sets the mesh's counts to what is filled. */
sdm_status sdm_builder_vertex(sdm_builder *b, const double x[3], sdm_error *err);
sdm_status sdm_builder_triangle(sdm_builder *b, uint32_t v0, uint32_t v1, uint32_t v2,
                                sdm_error *err);
sdm_status sdm_builder_finish(sdm_builder *b, sdm_error *err);

/* A polygon given corner by corner becomes a fan around its first corner. Start with n = 0. */
typedef struct sdm_fan {
    size_t n;
    uint32_t first, last;
} sdm_fan;
sdm_status sdm_builder_corner(sdm_builder *b, sdm_fan *fan, uint32_t vertex, sdm_error *err);

#ifdef __cplusplus
}
#endif

#endif
