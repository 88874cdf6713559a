/* Measures of a fitted shape with standard deviations, by propagation of the covariance. */
#include <math.h>
#include <string.h>

#include "posterior.h"
#include "sdm/memory.h"

// least step of the differences, as a share of the parameter's range
#define STEP_MIN 1e-3

/* gradient[SDM_MEASURES_MAX] = derivatives of the measures by parameter k at p[n]: differences over
 * one standard deviation to either side, which average over kinks as the parameter itself does; at
 * an end of the range they are one-sided. below, above: scratch memory. */
static sdm_status differentiate(const sdm_instance *shape, const sdm_fit_result *fit, double *p,
                                size_t k, const double *depths, size_t n_depths,
                                sdm_measures *below, sdm_measures *above, double *gradient,
                                sdm_error *err)
{
    size_t n;
    const sdm_param *q = &sdm_instance_params(shape, &n)[k];
    const double at = p[k],
                 step = fmax(STEP_MIN * (q->max - q->min), sqrt(fit->covariance[k * (n + 7)])),
                 low = fmax(at - step, q->min), high = fmin(at + step, q->max);
    p[k] = low;
    sdm_status s = sdm_shape_measure(shape, p, depths, n_depths, below, err);
    p[k] = high;
    if (!s) s = sdm_shape_measure(shape, p, depths, n_depths, above, err);
    p[k] = at;
    for (size_t i = 0; i < below->n && !s; i++)
        gradient[i] = (above->at[i].value - below->at[i].value) / (high - low);
    return s;
}

/* Sets the standard deviation of measure i: gradient[k][SDM_MEASURES_MAX]. */
static void propagate(const sdm_fit_result *fit, const double *gradient, size_t i,
                      sdm_measured *out)
{
    const size_t n = fit->n_params, size = n + 6;
    double variance = 0, before = 0;
    for (size_t a = 0; a < n; a++) {
        const double ga = gradient[a * SDM_MEASURES_MAX + i];
        for (size_t b = 0; b < n; b++)
            variance += ga * fit->covariance[a * size + b] * gradient[b * SDM_MEASURES_MAX + i];
        before += pow(ga * fit->prior_sd[a], 2);
    }
    // rounding may leave a variance of 0 a little negative; a covariance that is not positive
    // definite tells nothing
    out->sd = variance >= 0 ? sqrt(variance) : variance > -1e-12 * before ? 0 : NAN;
    out->not_determined = out->sd > FIT_BY_PRIOR * sqrt(before);
}

sdm_status sdm_fit_measure(const sdm_instance *shape, const sdm_fit_result *fit,
                           const double *depths, size_t n_depths, sdm_measures *out, sdm_error *err)
{
    size_t n = 0;
    if (!out) return sdm_fail(err, SDM_E_ARG, "a place for the measures is needed");
    out->n = 0;
    if (!shape || !fit || !fit->params)
        return sdm_fail(err, SDM_E_ARG, "measures: a shape and its fit are needed");
    (void)sdm_instance_params(shape, &n);
    if (n != fit->n_params)
        return sdm_fail(err, SDM_E_ARG, "measures: the shape has %zu parameters, the fit %zu", n,
                        fit->n_params);
    struct {
        sdm_measures below, above;
    } *scratch = NULL;
    double *p = NULL, *gradient = NULL;
    sdm_status s = SDM_ALLOC(&scratch, 1, "measures", err);
    if (!s) s = SDM_ALLOC(&p, n, "measures", err);
    if (!s) s = SDM_ALLOC(&gradient, n * SDM_MEASURES_MAX, "measures", err);
    if (!s) memcpy(p, fit->params, n * sizeof *p);
    if (!s) s = sdm_shape_measure(shape, p, depths, n_depths, out, err);
    for (size_t k = 0; k < n && !s; k++)
        s = differentiate(shape, fit, p, k, depths, n_depths, &scratch->below, &scratch->above,
                          gradient + k * SDM_MEASURES_MAX, err);
    for (size_t i = 0; i < out->n && !s; i++) propagate(fit, gradient, i, &out->at[i]);
    if (s) out->n = 0;
    sdm_free(gradient);
    sdm_free(p);
    sdm_free(scratch);
    return s;
}
