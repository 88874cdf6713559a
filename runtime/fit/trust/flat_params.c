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
// smallest change that is tried, as a share of the range: of points without errors rounding hides
// the likelihood of smaller ones
#define LEAST 1e-4
// the likelihood is flatter than the parabola if it asks for a deviation this many times as large
#define FLATTER 1.5

// a parameter hangs on so few points, if they give it this share of its information
#define POINTS_FEW 3
#define SHARE_OF_FEW 0.5

typedef struct scan {
    fit_problem *p;
    const sdm_fit_result *r;
    const double *influence; // inverse of the information
    double *few;             // the same without the few points on which a parameter hangs
    double *work;            // 3 N N numbers
    double here;             // log-posterior density at the estimate
} scan;

/* What point i says about parameter k, by its row of the inverse of the information. */
static double information_of(const fit_problem *p, const double *row, size_t i)
{
    const fit_samples *s = &p->samples;
    fit_likelihood l;
    double along = 0;
    if (s->row[i] == SIZE_MAX) return 0;
    sdm_fit_likelihood(&p->observation, 0, NULL, s->field[i], true, &l);
    for (size_t j = 0; j < s->n_columns; j++)
        along += row[j] * (double)s->jacobian[s->row[i] * s->n_columns + j];
    return l.complete[0] * along * along;
}

/* The points that say most about parameter k. Returns the share of all information in them. */
static double find_few(const scan *c, size_t k, size_t few[POINTS_FEW])
{
    const fit_problem *p = c->p;
    const double *row = c->influence + k * p->information.n_unknowns;
    double most[POINTS_FEW] = {0}, all = 0, share = 0;
    for (size_t j = 0; j < POINTS_FEW; j++) few[j] = SIZE_MAX;
    for (size_t i = 0; i < p->samples.n; i++) {
        const double x = information_of(p, row, i);
        size_t at = POINTS_FEW;
        all += x;
        for (; at > 0 && x > most[at - 1]; at--)
            if (at < POINTS_FEW) most[at] = most[at - 1], few[at] = few[at - 1];
        if (at < POINTS_FEW) most[at] = x, few[at] = i;
    }
    for (size_t j = 0; j < POINTS_FEW; j++) share += most[j];
    return all > 0 ? share / all : 0;
}

/* c->few = the inverse of the information without these points. false: it has none. */
static bool leave_out(const scan *c, const size_t few[POINTS_FEW])
{
    fit_problem *p = c->p;
    const fit_samples *s = &p->samples;
    const size_t n = p->information.n_unknowns;
    for (int sign = -1; sign <= 1; sign += 2) {
        for (size_t j = 0; j < POINTS_FEW; j++) {
            if (few[j] == SIZE_MAX) continue;
            const float *row = s->jacobian + s->row[few[j]] * s->n_columns;
            fit_likelihood l;
            sdm_fit_likelihood(&p->observation, 0, NULL, s->field[few[j]], true, &l);
            for (size_t a = 0; a < s->n_columns; a++)
                for (size_t b = 0; b < s->n_columns; b++) {
                    const double product = sign * (double)row[a] * (double)row[b];
                    p->information.complete[a * n + b] += l.complete[0] * product;
                    p->information.observed[a * n + b] += l.observed[0] * product;
                }
        }
        // then the points are added again
        if (sign < 0 && !sdm_fit_influence(p, true, c->few, c->work)) c->few[0] = NAN;
    }
    return !isnan(c->few[0]);
}

/* Loss of log-posterior density where parameter k changes by *off; *off becomes the change within
   the bounds. row: the other unknowns follow in these proportions; NULL: they keep their values.
   NAN: there is no shape. */
static sdm_status measure_loss(const scan *c, size_t k, const double *row, double *off,
                               double *loss, sdm_error *err)
{
    fit_problem *p = c->p;
    const fit_state estimate = p->state;
    const size_t n_moved = row ? p->n_params + 6 : 0;
    double step[FIT_UNKNOWNS_MAX] = {0}, there;
    for (size_t i = 0; i < n_moved; i++) step[i] = *off * row[i] / row[k];
    step[k] = *off;
    sdm_fit_state_move(p, &estimate, step, &p->state);
    *off = p->state.params[k] - estimate.params[k];
    const sdm_status s = sdm_fit_log_likelihood(p, p->state.params, &there, err);
    *loss = s ? NAN : c->here - there - sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    p->state = estimate;
    return s == SDM_E_NOMEM || s == SDM_E_CANCELLED ? s : SDM_OK;
}

// whether the loss at NEAR standard deviations, up or down, is smaller than that of the parabola
static sdm_status find_flatter(const scan *c, size_t k, const double *row, bool *flatter,
                               sdm_error *err)
{
    const double variance = c->influence[k * (c->p->information.n_unknowns + 1)];
    sdm_status s = SDM_OK;
    *flatter = false;
    for (int side = -1; side <= 1 && !s; side += 2) {
        const double range = c->p->high[k] - c->p->low[k];
        double off = side * fmax(NEAR * c->r->sd[k], LEAST * range), loss;
        s = measure_loss(c, k, row, &off, &loss, err);
        if (fabs(off) > 0.5 * NEAR * c->r->sd[k])
            *flatter = *flatter || FLATTER * FLATTER * 2 * variance * loss < off * off;
    }
    return s;
}

// *sd = the least standard deviation, up to `most`, of a normal distribution about the estimate of
// parameter k that has no tried value less likely than the points have it
static sdm_status scan_range(const scan *c, size_t k, const double *row, double most, double *sd,
                             sdm_error *err)
{
    const double factor = fmax(c->r->noise_factor, 1), at = c->p->state.params[k];
    sdm_status s = SDM_OK;
    *sd = 0;
    for (int side = -1; side <= 1; side += 2) {
        const double end = side < 0 ? at - c->p->low[k] : c->p->high[k] - at;
        const double first = fmax(FIRST * c->r->sd[k], LEAST * (c->p->high[k] - c->p->low[k]));
        for (double far = first; far < 2 * end && !s; far *= 2) {
            double off = side * far, loss;
            s = measure_loss(c, k, row, &off, &loss, err);
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

// raises the variance of parameter k to `variance`, and all that follows it in the proportions of
// row[]
static void widen_along(sdm_fit_result *out, size_t k, const double *row, double variance)
{
    const size_t n = out->n_params, size = n + 6;
    const double more = variance - out->covariance[k * (size + 1)];
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++)
            out->covariance[i * size + j] += more * (row[i] / row[k]) * (row[j] / row[k]);
    for (size_t i = 0; i < size; i++)
        if (row[i] != 0) out->sd[i] = sqrt(out->covariance[i * (size + 1)]);
    for (size_t i = 0; i < 6; i++)
        out->pose_sd_determined[i] = sqrt(out->pose_sd_determined[i] * out->pose_sd_determined[i] +
                                          more * (row[n + i] / row[k]) * (row[n + i] / row[k]));
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++) {
            const double sds = out->sd[i] * out->sd[j];
            if (i != j && sds > 0 && isfinite(sds))
                out->correlation[i * size + j] = out->covariance[i * size + j] / sds;
        }
}

// widens the deviation of parameter k, if the likelihood asks for it
static sdm_status spread(const scan *c, size_t k, sdm_fit_result *out, sdm_error *err)
{
    const double before = sdm_fit_prior_sd(c->p, k);
    // few points on which the parameter hangs hold it only as far as the surface that it moves lies
    // on them: the information of all other points tells how the other unknowns follow the
    // parameter
    size_t few[POINTS_FEW];
    const bool hangs = find_few(c, k, few) > SHARE_OF_FEW && leave_out(c, few);
    const double *row = (hangs ? c->few : c->influence) + k * c->p->information.n_unknowns;
    bool flatter = out->sd[k] > KNOWN * before;
    double alone = 0, followed = 0;
    sdm_status s = flatter ? SDM_OK : find_flatter(c, k, row, &flatter, err);
    if (!s && flatter) s = scan_range(c, k, NULL, before, &alone, err);
    if (!s && flatter && hangs) s = scan_range(c, k, row, before, &followed, err);
    if (!s && followed > out->sd[k]) widen_along(out, k, row, followed * followed);
    if (!s && alone > out->sd[k]) widen(out, k, alone * alone);
    return s;
}

sdm_status sdm_fit_flat_params_spread(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    if (p->opts->keep_params || p->target->kind != SDM_FIT_POINTS) return SDM_OK;
    const size_t n = p->information.n_unknowns;
    double *work = NULL;
    sdm_status s = SDM_ALLOC(&work, 5 * n * n, "matrices of the fit", err);
    scan c = {.p = p, .r = out, .influence = work};
    if (!s) c.few = work + n * n, c.work = work + 2 * n * n;
    const bool known = !s && sdm_fit_influence(p, true, work, c.work);
    if (known) s = sdm_fit_log_likelihood(p, p->state.params, &c.here, err);
    c.here += sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    for (size_t k = 0; k < p->n_params && known && !s; k++)
        if (out->sd[k] > 0 && out->sd[k] <= FIT_BY_PRIOR * sdm_fit_prior_sd(p, k))
            s = spread(&c, k, out, err);
    sdm_free(work);
    return s ? s : sdm_fit_evaluate(p, err);
}
