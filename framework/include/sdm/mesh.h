/* Triangle meshes: storage and audit. */
#ifndef SDM_MESH_H
#define SDM_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Zero-initialise; sdm_mesh_dispose() frees. vert[n_vert][3] in mm, tri[n_tri][3] vertex indices,
   counter-clockwise seen from outside. */
typedef struct sdm_mesh {
    double *vert;
    uint32_t *tri;
    size_t n_vert, n_tri;
    size_t cap_vert, cap_tri;
} sdm_mesh;

/* Sets n_vert and n_tri and makes room for them; the content is then the caller's to write. Old
   content is kept as far as it fits. SDM_E_MESH over 2^31 vertices or triangles, SDM_E_NOMEM. */
SDM_API sdm_status sdm_mesh_reserve(sdm_mesh *m, size_t n_vert, size_t n_tri, sdm_error *err);
SDM_API sdm_status sdm_mesh_copy(const sdm_mesh *from, sdm_mesh *to, sdm_error *err);
SDM_API void sdm_mesh_dispose(sdm_mesh *m);

/* What an audit finds; counts are of triangles unless said otherwise. */
typedef struct sdm_audit {
    size_t n_vert, n_tri;
    size_t degenerate;         /* zero area, or a repeated vertex */
    size_t duplicate;          /* the same three vertices as an earlier triangle */
    size_t boundary_edges;     /* edges with one triangle */
    size_t nonmanifold_edges;  /* edges with three or more */
    size_t misoriented_edges;  /* edges whose two triangles run along them in the same direction */
    size_t components;         /* connected by edges */
    size_t self_intersections; /* pairs of triangles that cross and share no vertex */
    double volume;             /* signed, mm^3; negative: the mesh is inside out */
    double area;               /* mm^2 */
    double min[3], max[3];     /* bounding box, mm */
    bool closed; /* no boundary edge, every edge balanced in direction: crossings define the inside
                  */
    bool manifold; /* closed, and every edge has two triangles of one orientation */
    bool inverted; /* closed, and the volume is negative beyond rounding of the coordinates */
} sdm_audit;

/* Examines a mesh. SDM_E_MESH: no triangle, an index out of range, a coordinate that is not finite
   or above 1e70, a largest one below 1e-70 (all 0 will do). Between these the result is scale free:
   no absolute tolerance is used. [any thread] */
SDM_API sdm_status sdm_mesh_audit(const sdm_mesh *m, sdm_audit *out, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
