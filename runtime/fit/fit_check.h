/* Checks of the arguments of sdm_fit(), before anything is computed. */
#pragma once

#include "sdm/fit.h"

/* Checks the source. *n_params: number of its parameters. SDM_E_ARG: the source is invalid;
 * SDM_E_UNSUPPORTED: n_params < 1 or n_params > FIT_PARAMS_MAX. */
sdm_status sdm_fit_check_source(const sdm_fit_source *source, size_t *n_params, sdm_error *err);

/* Checks target and options. SDM_E_ARG: one of them is invalid; SDM_E_FORMAT: values that an image,
 * label map or point list must not have; SDM_E_QUALITY: the image is constant. */
sdm_status sdm_fit_check(const sdm_fit_target *target, const sdm_fit_opts *opts, sdm_error *err);

/* Checks sdm_fit_opts.open_end, after both of the above. SDM_E_ARG: the target are points; there is
 * no instance of the shape; it states no open end. */
sdm_status sdm_fit_check_open_end(const sdm_fit_source *source, const sdm_fit_target *target,
                                  const sdm_fit_opts *opts, sdm_error *err);
