/* Inside of the mesh file readers: a mesh that grows, one function pair a format. */
#ifndef SDM_IO_MESHPARTS_H
#define SDM_IO_MESHPARTS_H

#include "bytes.h"
#include "scan.h"
#include "sdm/meshfile.h"

/* A mesh under construction: n_vert and n_tri say what is filled, the mesh's own counts what there is room for. */
typedef struct sdm_builder {
    const char *path; /* for messages */
    sdm_mesh *mesh;
    size_t n_vert, n_tri;
} sdm_builder;

/* Both grow geometrically; sdm_builder_finish() sets the mesh's counts to what is filled. */
sdm_status sdm_builder_vertex(sdm_builder *b, const double x[3], sdm_error *err);
sdm_status sdm_builder_triangle(sdm_builder *b, uint32_t v0, uint32_t v1, uint32_t v2, sdm_error *err);
sdm_status sdm_builder_finish(sdm_builder *b, sdm_error *err);

/* A polygon given corner by corner becomes a fan around its first corner. Start with n = 0. */
typedef struct sdm_fan {
    size_t n;
    uint32_t first, last;
} sdm_fan;
sdm_status sdm_builder_corner(sdm_builder *b, sdm_fan *fan, uint32_t vertex, sdm_error *err);

/* Readers take the whole file (one zero byte behind it) and may write to it; the mesh is finished by the caller. */
sdm_status sdm_ply_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_stl_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_obj_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);
sdm_status sdm_off_read(sdm_builder *b, uint8_t *data, size_t size, sdm_error *err);

/* Writers get a mesh whose indices and coordinates have been checked. */
sdm_status sdm_ply_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_stl_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_obj_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);
sdm_status sdm_off_write(sdm_outfile *f, const sdm_mesh *m, sdm_error *err);

#endif
