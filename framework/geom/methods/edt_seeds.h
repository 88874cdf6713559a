/* Seeds of the distance transform: the points where the lines of the grid cross the surface. */
#ifndef SDM_GEOM_METHODS_EDT_SEEDS_H
#define SDM_GEOM_METHODS_EDT_SEEDS_H

#include "method.h"

/* Crossings of the lines along one axis. Line number: the two other indices, the lower axis
 * fastest. */
typedef struct sdm_seeds {
    uint32_t *first; /* [n_lines + 1] */
    double *at;      /* [n] index coordinate along the axis, in no order */
    size_t n;
} sdm_seeds;

/* index: the surface's vertices in index coordinates. *seeds is zero-initialised;
 * sdm_seeds_dispose() frees it. */
sdm_status sdm_seeds_build(sdm_run *run, const double *index, int axis, sdm_seeds *seeds,
                           sdm_error *err);
void sdm_seeds_dispose(sdm_seeds *seeds);

/* A proved bound on the error of the distances `map` (unsigned, to the nearest seed of the three
   axes). *bound is INFINITY when there is no seed. */
sdm_status sdm_seeds_bound(const sdm_run *run, const double *index, const sdm_seeds seeds[3],
                           const float *map, double *bound, sdm_error *err);

#endif
