/* What is known of the voxels of a grid beside their distance. */
#ifndef SDM_GEOM_LAYERS_H
#define SDM_GEOM_LAYERS_H

#include "features/nearest.h"
#include "sdm/exact.h"
#include "vertex_gradient.h"

typedef struct sdm_layers_job {
    sdm_sheets sheets;
    double rounding; /* distances up to this are on the surface */
    const sdm_exact_opts *opts;
    const float *values;  /* [nz][ny][nx] the map */
    const uint32_t *slot; /* [nz][ny][nx] of a nearest triangle, SDM_NONE beyond a narrow band */
    const sdm_exact_layers *out;
    const double *velocity; /* [n_velocity][n_vert of the mesh][3] */
    size_t n_velocity;
    float *derivative; /* [n_velocity][nz][ny][nx] */
} sdm_layers_job;

/* Is anything wanted but the values? */
bool sdm_layers_wanted(const sdm_layers_job *job);

/* Fills every layer but the values. The grid is checked. SDM_E_CANCELLED. */
sdm_status sdm_layers_fill(const sdm_layers_job *job, const sdm_grid *g, sdm_error *err);

/* Unit gradient at x of the signed distance d to the nearest point q, on triangle `slot`. */
void sdm_distance_gradient(const sdm_nearest *surface, double rounding, uint32_t slot,
                           const double x[3], const double q[3], double d, double n[3]);

#endif
