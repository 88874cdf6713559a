/* Layers of a map: per voxel the nearest triangle, nearest point, normal and derivatives, in
 * addition to the distance. */
#pragma once

#include "features/nearest.h"
#include "sdm/exact.h"
#include "vertex_gradient.h"

typedef struct sdm_layers_job {
    sdm_sheets sheets;
    double rounding; /* voxels with abs(distance) <= rounding lie on the surface, mm */
    const sdm_exact_opts *opts;
    const float *values; /* [nz][ny][nx] signed distance, mm */
    /* [nz][ny][nx] nearest triangle (slot of sheets.surface), SDM_NONE outside of a narrow band */
    const uint32_t *slot;
    const sdm_exact_layers *out;
    /* [n_velocity][n_vert][3] velocities of the vertices of sheets.mesh; see
     * sdm_exact_map_derivative() */
    const double *velocity;
    size_t n_velocity;
    float *derivative; /* [n_velocity][nz][ny][nx] result, NULL: not wanted */
} sdm_layers_job;

/* Is any layer other than the values requested? */
bool sdm_layers_wanted(const sdm_layers_job *job);

/* Fills all requested layers except the values. The grid must have passed sdm_grid_check(). Errors:
 * SDM_E_CANCELLED. */
sdm_status sdm_layers_fill(const sdm_layers_job *job, const sdm_grid *g, sdm_error *err);

/* n = unit gradient of the signed distance d (mm) at x. q: nearest surface point, on the triangle
 * with this slot. If x lies on the surface (abs(d) <= rounding), n is the normal of this
 * triangle. */
void sdm_distance_gradient(const sdm_nearest *surface, double rounding, uint32_t slot,
                           const double x[3], const double q[3], double d, double n[3]);
