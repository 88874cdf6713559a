/* The network's maps of a batch, compared with exact distances. */
#ifndef SDM_RUNTIME_CHECKED_H
#define SDM_RUNTIME_CHECKED_H

#include "sdm/runtime.h"

static inline bool sdm_wants_check(const sdm_generate_opts *o)
{
    return o->check || o->max_error_mm > 0;
}

/* Checks those of values[n][nz][ny][nx] that the network made at used[n][n_params], fills their
   results, and replaces them under the exact policy where they are over the bound. Otherwise
   SDM_E_QUALITY for the first of these, all checked. */
sdm_status sdm_check_results(const sdm_model *m, const double *used, size_t n,
                             const sdm_generate_opts *o, float *values, sdm_result *results,
                             sdm_error *err);

#endif
