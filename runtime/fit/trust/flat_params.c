/* The covariance takes the log-likelihood for a parabola about the estimate. A few points where a
 * part of the shape begins bend it there, although the part itself has no points, so that all of
 * its lengths are about as likely. The likelihood over the whole range shows it. */
#include "flat_params.h"

#include <math.h>

#include "fit/solver/objective.h"
#include "fit/solver/prior.h"
#include "posterior.h"

// parameters with a smaller standard deviation, over that before the fit, are known well enough
#define KNOWN 0.05
// values that are tried: the middles of this many equal parts of the range
enum { N_PARTS = 8 };

// *sd = the least standard deviation of a normal distribution about the estimate of parameter k
// that has no tried value less likely than the points have it, up to `most`
static sdm_status measure(fit_problem *p, size_t k, double noise_factor, double most, double *sd,
                          sdm_error *err)
{
    const double part = (p->high[k] - p->low[k]) / N_PARTS, at = p->state.params[k];
    double here;
    sdm_status s = sdm_fit_log_likelihood(p, p->state.params, &here, err);
    *sd = 0;
    for (int i = 0; i < N_PARTS && !s; i++) {
        fit_state other = p->state;
        double there;
        other.params[k] = p->low[k] + (i + 0.5) * part;
        const double off = fabs(other.params[k] - at);
        if (off < 0.5 * part) continue;
        s = sdm_fit_log_likelihood(p, other.params, &there, err);
        if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return s;
        const double loss = (here - there) / noise_factor;
        // without a shape at this value it says nothing
        if (!s) *sd = fmax(*sd, 2 * loss * most * most > off * off ? off / sqrt(2 * loss) : most);
        s = SDM_OK;
    }
    return s;
}

// sets the variance of parameter k, and with it its sd and correlations
static void widen(sdm_fit_result *out, size_t k, double variance)
{
    const size_t size = out->n_params + 6;
    const double narrower = out->sd[k] / sqrt(variance);
    out->covariance[k * (size + 1)] = variance;
    out->sd[k] = sqrt(variance);
    for (size_t i = 0; i < size; i++) {
        if (i == k) continue;
        out->correlation[k * size + i] *= narrower;
        out->correlation[i * size + k] *= narrower;
    }
}

sdm_status sdm_fit_flat_params_spread(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    bool tried = false;
    if (p->opts->keep_params || p->target->kind != SDM_FIT_POINTS) return SDM_OK;
    for (size_t k = 0; k < p->n_params; k++) {
        const double before = sdm_fit_prior_sd(p, k), sd = out->sd[k];
        double wide;
        if (!(sd > KNOWN * before && sd <= FIT_BY_PRIOR * before)) continue;
        tried = true;
        const sdm_status s = measure(p, k, fmax(out->noise_factor, 1), before, &wide, err);
        if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return s;
        if (!s && wide > sd) widen(out, k, wide * wide);
    }
    return tried ? sdm_fit_evaluate(p, err) : SDM_OK;
}
