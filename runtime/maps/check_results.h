/* Checks the maps that a network has computed, by exact distances. */
#pragma once

#include "sdm/runtime.h"

/* true if the options ask for a check of every map. */
static inline bool sdm_wants_check(const sdm_generate_opts *o)
{
    return o->check || o->max_error_mm > 0;
}

/* Checks those maps of values[n][nz][ny][nx] that the network has computed (results[i].source), at
   the parameters used[n][n_params], and completes their results[i]. A map above o->max_error_mm is
   replaced by the exact one under SDM_RANGE_EXACT. Under other policies the function returns
   SDM_E_QUALITY for the first such map, after it has checked all maps. */
sdm_status sdm_check_results(const sdm_model *m, const double *used, size_t n,
                             const sdm_generate_opts *o, float *values, sdm_result *results,
                             sdm_error *err);

/* Checks values[nz][ny][nx], a map by the network on `grid` at the parameters p, and completes
 *result; otherwise as sdm_check_results(). */
sdm_status sdm_check_result(const sdm_grid *grid, const double *p, const sdm_generate_opts *o,
                            int n_threads, float *values, sdm_result *result, sdm_error *err);
