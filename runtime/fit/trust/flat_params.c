/* The covariance takes the log-likelihood for a parabola about the estimate. Points that touch a
 * surface at an edge alone bend it there: they say how far the surface reaches at least, not where
 * it ends. The likelihood at other values shows it. */
#include "flat_params.h"

#include <math.h>

#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/prior.h"
#include "influence.h"
#include "posterior.h"
#include "sdm/memory.h"

// parameters with a larger standard deviation, over that before the fit, are tried over their whole
// range; the others only where the likelihood is flatter than the parabola near the estimate
#define KNOWN 0.05
// where flatness shows, in standard deviations: points at an edge are as good as points on both of
// its sides as long as the edge moves by less than their errors
#define NEAR 6.0
// the first value of a range that is tried, in standard deviations; each next one is twice as far
#define FIRST 2.0
// the likelihood is flatter than the parabola if it asks for a deviation this many times as large
#define FLATTER 1.5

typedef struct scan {
    fit_problem *p;
    const sdm_fit_result *r;
    const double *influence; // inverse of the information
    double here;             // log-posterior density at the estimate
} scan;

/* Loss of log-posterior density where parameter k changes by *off; *off becomes the change within
   the bounds. follow: the other unknowns follow, as the information has it; else they keep their
   values. NAN: there is no shape. */
static sdm_status measure_loss(const scan *c, size_t k, bool follow, double *off, double *loss,
                               sdm_error *err)
{
    fit_problem *p = c->p;
    const fit_state estimate = p->state;
    const size_t n = p->information.n_unknowns, n_moved = follow ? p->n_params + 6 : 0;
    double step[FIT_UNKNOWNS_MAX] = {0}, there;
    for (size_t i = 0; i < n_moved; i++)
        step[i] = *off * c->influence[k * n + i] / c->influence[k * (n + 1)];
    step[k] = *off;
    sdm_fit_state_move(p, &estimate, step, &p->state);
    *off = p->state.params[k] - estimate.params[k];
    const sdm_status s = sdm_fit_log_likelihood(p, p->state.params, &there, err);
    *loss = s ? NAN : c->here - there - sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    p->state = estimate;
    return s == SDM_E_NOMEM || s == SDM_E_CANCELLED ? s : SDM_OK;
}

// whether the loss at NEAR standard deviations, up or down, is smaller than that of the parabola
static sdm_status find_flatter(const scan *c, size_t k, bool *flatter, sdm_error *err)
{
    const double variance = c->influence[k * (c->p->information.n_unknowns + 1)];
    sdm_status s = SDM_OK;
    *flatter = false;
    for (int side = -1; side <= 1 && !s; side += 2) {
        double off = side * NEAR * c->r->sd[k], loss;
        s = measure_loss(c, k, true, &off, &loss, err);
        if (fabs(off) > 0.5 * NEAR * c->r->sd[k])
            *flatter = *flatter || FLATTER * FLATTER * 2 * variance * loss < off * off;
    }
    return s;
}

// *sd = the least standard deviation, up to `most`, of a normal distribution about the estimate of
// parameter k that has no tried value less likely than the points have it
static sdm_status scan_range(const scan *c, size_t k, double most, double *sd, sdm_error *err)
{
    const double factor = fmax(c->r->noise_factor, 1), at = c->p->state.params[k];
    sdm_status s = SDM_OK;
    *sd = 0;
    for (int side = -1; side <= 1; side += 2) {
        const double end = side < 0 ? at - c->p->low[k] : c->p->high[k] - at;
        for (double far = FIRST * c->r->sd[k]; far < 2 * end && !s; far *= 2) {
            double off = side * far, loss;
            s = measure_loss(c, k, false, &off, &loss, err);
            // at a bound next to the estimate, or without a shape, the loss says nothing
            if (s || !(fabs(off) > c->r->sd[k]) || isnan(loss)) continue;
            const double variance = loss > 0 ? factor * off * off / (2 * loss) : INFINITY;
            *sd = fmax(*sd, fmin(sqrt(variance), most));
        }
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

// widens the deviation of parameter k, if the likelihood asks for it
static sdm_status spread(const scan *c, size_t k, sdm_fit_result *out, sdm_error *err)
{
    const double before = sdm_fit_prior_sd(c->p, k);
    bool flatter = out->sd[k] > KNOWN * before;
    double wide = 0;
    sdm_status s = flatter ? SDM_OK : find_flatter(c, k, &flatter, err);
    if (!s && flatter) s = scan_range(c, k, before, &wide, err);
    if (!s && wide > out->sd[k]) widen(out, k, wide * wide);
    return s;
}

sdm_status sdm_fit_flat_params_spread(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    if (p->opts->keep_params || p->target->kind != SDM_FIT_POINTS) return SDM_OK;
    const size_t n = p->information.n_unknowns;
    double *work = NULL;
    sdm_status s = SDM_ALLOC(&work, 4 * n * n, "matrices of the fit", err);
    scan c = {.p = p, .r = out, .influence = work};
    const bool known = !s && sdm_fit_influence(p, true, work, work + n * n);
    if (known) s = sdm_fit_log_likelihood(p, p->state.params, &c.here, err);
    c.here += sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    for (size_t k = 0; k < p->n_params && known && !s; k++)
        if (out->sd[k] > 0 && out->sd[k] <= FIT_BY_PRIOR * sdm_fit_prior_sd(p, k))
            s = spread(&c, k, out, err);
    sdm_free(work);
    return s ? s : sdm_fit_evaluate(p, err);
}
