/* Triangle meshes: storage, and the audit of a mesh for errors. */
#ifndef SDM_MESH_H
#define SDM_MESH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A triangle mesh that owns its arrays. Zero-initialise; sdm_mesh_dispose() frees. */
typedef struct sdm_mesh {
    double *vert;             /* [n_vert][3] mm */
    uint32_t *tri;            /* [n_tri][3] vertex indices, counter-clockwise seen from outside */
    size_t n_vert, n_tri;     /* counts */
    size_t cap_vert, cap_tri; /* allocated counts */
} sdm_mesh;

/* Sets n_vert and n_tri and allocates the arrays for them; the caller then writes their content.
 * Old content is kept as far as it fits. SDM_E_MESH: more than 2^31 vertices or triangles;
 * SDM_E_NOMEM. */
SDM_API sdm_status sdm_mesh_reserve(sdm_mesh *m, size_t n_vert, size_t n_tri, sdm_error *err);

/* Copies `from` to `to`, which keeps arrays that are large enough. Errors as sdm_mesh_reserve(). */
SDM_API sdm_status sdm_mesh_copy(const sdm_mesh *from, sdm_mesh *to, sdm_error *err);

/* Frees the arrays and zeroes *m. m may be NULL. */
SDM_API void sdm_mesh_dispose(sdm_mesh *m);

/* Result of an audit. Vertices with equal coordinates count as one vertex. */
typedef struct sdm_audit {
    size_t n_vert, n_tri;
    size_t degenerate;         /* triangles without area (to rounding) or with a repeated vertex */
    size_t duplicate;          /* triangles with the same three vertices as an earlier one */
    size_t boundary_edges;     /* edges that belong to only one triangle */
    size_t nonmanifold_edges;  /* edges of three or more triangles */
    size_t misoriented_edges;  /* edges of two triangles that run along it in the same direction */
    size_t components;         /* sets of triangles connected by edges */
    size_t self_intersections; /* pairs of triangles that meet and share no vertex */
    double volume;             /* signed, mm^3; negative: the mesh is inside out */
    double area;               /* mm^2 */
    double min[3], max[3];     /* bounding box, mm */
    /* on every edge as many triangles run in one direction as in the other: integer winding numbers
     * then define the inside */
    bool closed;
    bool manifold; /* closed, and every edge has exactly two triangles */
    bool inverted; /* closed, and the volume is negative by more than its rounding error */
} sdm_audit;

/* Audits a mesh. SDM_E_MESH: no triangle, an index out of range, a coordinate that is not finite or
 * with abs(coordinate) > 1e70, or all abs(coordinate) < 1e-70 (unless all are 0). Otherwise scaling
 * the mesh does not change the findings: all tolerances are relative. SDM_E_ARG, SDM_E_NOMEM.
 * [any thread] */
SDM_API sdm_status sdm_mesh_audit(const sdm_mesh *m, sdm_audit *out, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
