/* What sdm_fit() is asked, before anything is computed. */
#ifndef FIT_CHECK_H
#define FIT_CHECK_H

#include "sdm/fit.h"

/* A source alone; *n_params receives the number of its parameters. */
sdm_status sdm_fit_check_source(const sdm_fit_source *source, size_t *n_params, sdm_error *err);

/* Bounds of parameter k under the source's policy, and its name. */
void sdm_fit_bounds(const sdm_fit_source *source, size_t k, double *low, double *high,
                    const char **name);

sdm_status sdm_fit_check(const sdm_fit_target *target, const sdm_fit_opts *opts, sdm_error *err);

#endif
