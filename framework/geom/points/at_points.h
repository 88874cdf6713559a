/* Signed distances, nearest points and gradients at points in any order. */
#pragma once

#include "layers/layers.h"
#include "sdm/exact.h"
#include "sign/sign.h"

/* What the answers need besides the points. */
typedef struct sdm_points_job {
    const sdm_nearest *surface;
    const sdm_sign *sign;
    /* points with a smaller abs(distance) lie on the surface, mm; see sdm_distance_gradient() */
    double rounding;
    /* bound on the distance between the surface and the solid from which the sign comes, mm */
    double seam;
    const sdm_exact_opts *opts;
} sdm_points_job;

/* Answers for the points x[n][3], see sdm_exact_points(). SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_points_find(const sdm_points_job *job, const double *x, size_t n,
                           const sdm_exact_at *out, sdm_error *err);

/* The answer for one point, the same bits; index: element of the arrays of `out`. */
void sdm_point_find(const sdm_points_job *job, const double x[3], const sdm_exact_at *out,
                    size_t index);

/* Absolute value of the distance of sdm_point_find(). */
double sdm_point_distance(const sdm_nearest *surface, const double x[3]);
