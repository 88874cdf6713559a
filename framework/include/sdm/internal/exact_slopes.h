/* Derivatives, by parameters that move the vertices of a mesh, of its signed distance at points. */
#pragma once

#include "sdm/exact.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The derivatives of one engine by n parameters. */
typedef struct sdm_exact_slopes sdm_exact_slopes;

/* *out: for velocity[n][n_vert][3] = d(vertex)/d(parameter) of the mesh of the engine. Engine and
 * velocities must outlive it; free it with sdm_exact_slopes_free(). SDM_E_NOMEM. [any thread] */
sdm_status sdm_exact_slopes_create(const sdm_exact *e, const double *velocity, size_t n,
                                   sdm_exact_slopes **out, sdm_error *err);

/* Frees it; s may be NULL. */
void sdm_exact_slopes_free(sdm_exact_slopes *s);

/* slopes[n] = d(distance)/d(parameter) at the point x, as sdm_exact_map_derivative() defines it,
 * from element `index` of the answers of sdm_exact_points() or sdm_exact_point(), none of which may
 * be NULL; NaN if the point has no answer. Allocates nothing. [any thread] */
void sdm_exact_slopes_at(const sdm_exact_slopes *s, const double x[3], const sdm_exact_at *answers,
                         size_t index, double *slopes);

#ifdef __cplusplus
}
#endif
