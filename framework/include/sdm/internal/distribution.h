/* Distributions of the parameters of a shape: uniform on the range of the parameter, or normal and
 * truncated to it. */
#pragma once

#include "sdm/shape.h"
#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* SDM_E_ARG unless the distribution fits the range min < max: a known kind; normal: mean finite,
 * 0 < deviation <= 1000 (max - min), and a probability of at least 1e-9 of lying in the range
 * before the truncation. The message names the figures, not the parameter. [any thread] */
sdm_status sdm_distribution_check(const sdm_distribution *d, double min, double max,
                                  sdm_error *err);

/* The quantile of the distribution on min .. max, i.e. the value below which a fraction u, 0 .. 1,
 * of the probability lies. If the distribution passes the check, the error is below 1e-12 of
 * the range and of the deviation, plus the rounding of the result. 0 gives min, 1 gives max. [any
 * thread] */
double sdm_distribution_quantile(const sdm_distribution *d, double min, double max, double u);

/* buf[80] = "uniform", or "normal, mean 0, deviation 1". Returns buf. */
const char *sdm_distribution_text(const sdm_distribution *d, char buf[80]);

#ifdef __cplusplus
}
#endif
