/* Inside or outside: the choice of the method, points and grids. */
#ifndef SDM_GEOM_SIGN_H
#define SDM_GEOM_SIGN_H

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
    const sdm_nearest
        *surface; /* the solid's surface without what lies inside; asked for pseudo-normals only */
    sdm_winding winding;
    sdm_pseudonormals normals;
} sdm_sign;

/* The method to use where `wanted` is. SDM_E_ARG where it does not fit the mesh. */
sdm_status sdm_sign_choose(const sdm_audit *a, sdm_sign_method wanted, sdm_sign_method *method,
                           sdm_error *err);

/* What is pointed to must stay as long as *s. *s is zero-initialised; sdm_sign_dispose() frees it,
 * also after an error. */
sdm_status sdm_sign_build(const sdm_mesh *solid, const sdm_survey *survey,
                          const sdm_nearest *surface, sdm_sign_method method, sdm_sign *s,
                          sdm_error *err);
void sdm_sign_dispose(sdm_sign *s);

/* Bytes that *s has allocated. */
size_t sdm_sign_bytes(const sdm_sign *s);

/* Is x inside? slot, q, feature: its nearest point, used for pseudo-normals only. [any thread] */
bool sdm_sign_inside(const sdm_sign *s, const double x[3], uint32_t slot, const double q[3],
                     int feature);

/* Turns the sign of values[nz][ny][nx] of the voxels inside; the same for any number of threads.
   Uses n_threads, memory_limit, cancelled and user of opts. */
sdm_status sdm_sign_map(const sdm_sign *s, const sdm_grid *g, const sdm_exact_opts *opts,
                        float *values, sdm_error *err);

/* Compares the signs of a map with other ways to find them: see sdm_exact_certify(). rounding:
   distance of a voxel that may count as on the surface. */
sdm_status sdm_sign_certify(const sdm_sign *s, const sdm_grid *g, const sdm_exact_opts *opts,
                            double rounding, const float *values, sdm_sign_certificate *out,
                            sdm_error *err);

#endif
