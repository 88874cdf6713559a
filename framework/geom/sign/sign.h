/* Decides whether points lie inside a mesh: chooses the sign method, and finds the signs of single
 * points and of whole grids. */
#pragma once

#include <stdbool.h>

#include "features/nearest.h"
#include "pseudonormal.h"
#include "sdm/exact.h"
#include "solid/survey.h"
#include "winding.h"

typedef struct sdm_sign {
    sdm_sign_method method;
    const sdm_mesh *solid;
    const sdm_survey *survey;
    /* the surface to which distances are measured (after the union, without triangles inside the
     * solid); used by pseudo-normals only */
    const sdm_nearest *surface;
    sdm_winding winding;
    sdm_pseudonormals normals;
} sdm_sign;

/* Resolves SDM_SIGN_AUTO to the method for this mesh; any other `wanted` is checked and copied.
 * SDM_E_ARG when the mesh does not meet the requirements of the method. */
sdm_status sdm_sign_choose(const sdm_audit *a, sdm_sign_method wanted, sdm_sign_method *method,
                           sdm_error *err);

/* Prepares the sign queries for `solid`. The mesh, the survey and the surface must stay valid as
 * long as *s. *s is zero-initialised; sdm_sign_dispose() frees it, also after an error.
 * SDM_E_NOMEM. */
sdm_status sdm_sign_build(const sdm_mesh *solid, const sdm_survey *survey,
                          const sdm_nearest *surface, sdm_sign_method method, sdm_sign *s,
                          sdm_error *err);
void sdm_sign_dispose(sdm_sign *s);

/* Bytes allocated by *s. */
size_t sdm_sign_bytes(const sdm_sign *s);

/* Is x inside? slot: nearest triangle of s->surface; q: nearest point; feature: where q lies on the
 * triangle (point_triangle.h). These three are used by pseudo-normals only. [any thread] */
bool sdm_sign_inside(const sdm_sign *s, const double x[3], uint32_t slot, const double q[3],
                     int feature);

/* Negates values[nz][ny][nx] at the voxels inside; same result for any number of threads. Uses
 * n_threads, memory_limit, cancelled and user of opts. SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_sign_map(const sdm_sign *s, const sdm_grid *g, const sdm_exact_opts *opts,
                        float *values, sdm_error *err);

/* Negates the values of blocks inside the mesh, and sets SDM_TILE_INSIDE for tiles without block
 * inside. For closed meshes only. The rest as sdm_sign_map(). */
sdm_status sdm_sign_blocks(const sdm_sign *s, const sdm_exact_opts *opts, sdm_blocks *b,
                           sdm_error *err);

/* Compares the signs of a map with those of other methods: see sdm_exact_certify(). Voxels with
 * abs(value) <= rounding (mm) lie on the surface up to rounding and are not compared. SDM_E_NOMEM,
 * SDM_E_CANCELLED. */
sdm_status sdm_sign_certify(const sdm_sign *s, const sdm_grid *g, const sdm_exact_opts *opts,
                            double rounding, const float *values, sdm_sign_certificate *out,
                            sdm_error *err);
