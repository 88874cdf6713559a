/* The parameters of the source of a fit: of a model or of a shape. */
#pragma once

#include "sdm/fit.h"

/* Bounds of parameter k of a checked source under its policy, in the unit of the parameter, and its
 * name, which the source owns. */
void sdm_fit_bounds(const sdm_fit_source *source, size_t k, double *low, double *high,
                    const char **name);

/* Distribution of parameter k of a checked source: that of the model or, without a model, of the
 * shape. */
sdm_distribution sdm_fit_distribution(const sdm_fit_source *source, size_t k);
