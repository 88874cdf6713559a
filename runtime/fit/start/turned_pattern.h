/* A pattern in every rotation of a set, for fast scores at boxes of an image. */
#pragma once

#include "pattern.h"

typedef struct fit_turned {
    /* number of points in the shape, and of all points */
    size_t n_inside, n;
    /* [n_turns][n] offset of the box of each point from that of the centroid */
    int32_t *offset;
} fit_turned;

/* Every stride-th point of p in n_turns rotations over the sphere. SDM_E_NOMEM. */
sdm_status sdm_fit_turned_make(const fit_pattern *p, const fit_likeness *l, size_t n_turns,
                               size_t stride, fit_turned *out, sdm_error *err);
void sdm_fit_turned_dispose(fit_turned *t);

/* Score in rotation r, as of sdm_fit_pattern_score() without interpolation, with the centroid in
 * the box *at, which must lie in the image. */
double sdm_fit_turned_score(const fit_turned *t, size_t r, const uint8_t *at);
