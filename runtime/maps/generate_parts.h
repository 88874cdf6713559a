/* Checks before and after a map is computed, for other files of the runtime. */
#pragma once

#include "sdm/runtime.h"

/* Checks the options; those of opts (NULL: the defaults) are copied to *o. SDM_E_ARG. */
sdm_status sdm_generate_check_options(const sdm_model *m, const sdm_generate_opts *opts,
                                      sdm_generate_opts *o, sdm_error *err);

/* Checks params[n_params] by the policy of checked options. used[n_params] (may be NULL) =
   parameters for the network: clamped to the trained range. *result = how the map is to be
   computed. Errors as sdm_generate(). */
sdm_status sdm_generate_check_params(const sdm_model *m, const double *params,
                                     const sdm_generate_opts *o, double *used, sdm_result *result,
                                     sdm_error *err);

/* true: a voxel of values[nz][ny][nx] at the border of the grid is inside the shape, so the surface
   leaves the grid there. Axes of one voxel have no border: a slice cuts every shape. [any thread]
 */
bool sdm_generate_is_cut(const sdm_grid *grid, const float *values);
