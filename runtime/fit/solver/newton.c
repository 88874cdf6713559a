/* Damped Newton steps (Levenberg 1944, Marquardt 1963) with the information of the observed values
   (Louis 1982) where it is positive definite, of the complete ones elsewhere: the step is then that
   of expectation-maximisation. */
#include "newton.h"

#include <math.h>
#include <string.h>

#include "anderson.h"
#include "averaged_gradient.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rotation.h"
#include "tissues.h"

// largest step of one iteration: share of a range, rad, share of the shape's reach
#define STEP_MOST 0.25
// a gain in log-likelihood, of values that are independent, that means nothing (a few hundredths of
// a standard deviation): steps that promise less, or less than what rounding makes, are taken
// without asking whether they gain
#define GAIN_LEAST 1e-3
#define DAMPING_MOST 1e8
// standard deviation of the logistic law of scale 1, pi / sqrt(3)
#define LOGISTIC_SD 1.8137993642342178
// with more of it the size of a step says nothing of how far the maximum is
#define DAMPING_TRUE 0.1
// steps below which they are accelerated, and the most an acceleration changes an unknown, in its
// unit
#define STEP_RUSHED 0.01
#define RUSH_MOST 0.1
// where averaged derivatives are steep, the steps that are taken go to nothing, plain ones only to
// so many times the end
#define STEEP_MOST 10.0
// and with averaged derivatives, in plain steps
#define RUSH_AVERAGED 4.0

// the logistic law of labels is seen through its own spread: its edge would lie inside of a curved
// surface
double sdm_fit_field_blur(const fit_problem *p)
{
    const bool labels = !p->maps.share && p->target->kind != SDM_FIT_POINTS;
    return labels ? p->state.l_ref * LOGISTIC_SD : p->maps.share ? p->state.blur : 0;
}

sdm_status sdm_fit_value(fit_problem *p, const double *params, double *log_likelihood,
                         sdm_error *err)
{
    p->maps_at[0] = p->packed_blur = NAN;
    const sdm_status s = sdm_fit_maps_at(&p->maps, params, false, err);
    if (s) return s;
    sdm_fit_maps_pack(&p->maps, sdm_fit_field_blur(p), false);
    *log_likelihood = sdm_fit_sums_value(&p->sites, &p->maps, &p->laws, &p->state);
    return SDM_OK;
}

sdm_status sdm_fit_look(fit_problem *p, sdm_error *err)
{
    const fit_state *s = &p->state;
    sdm_status status = SDM_OK;
    bool same = true;
    for (size_t k = 0; k < p->n_params; k++) same = same && p->maps_at[k] == s->params[k];
    if (!same) {
        p->packed_blur = p->maps_at[0] = NAN;
        status = sdm_fit_maps_at(&p->maps, s->params, true, err);
        if (!status) memcpy(p->maps_at, s->params, p->n_params * sizeof *s->params);
    } else if (p->maps.cancelled && p->maps.cancelled(p->maps.user)) {
        status = sdm_fail(err, SDM_E_CANCELLED, "fit stopped on request");
    }
    if (status) return status;
    const double blur = sdm_fit_field_blur(p);
    if (!(p->packed_blur == blur)) {
        sdm_fit_maps_pack(&p->maps, blur, true);
        p->packed_blur = blur;
    }
    sdm_fit_laws_prepare(p->opts, p->target->kind, s, &p->laws);
    status = sdm_fit_sites_sample(&p->sites, &p->maps, &p->laws, s, err);
    if (!status) sdm_fit_sums_fill(&p->sums, &p->sites, &p->laws, p->opts->n_threads);
    return status;
}

void sdm_fit_move(const fit_problem *p, const fit_state *from, const double *step, fit_state *to)
{
    const size_t n = p->n_params;
    *to = *from;
    for (size_t k = 0; k < n; k++)
        to->params[k] = fmin(fmax(from->params[k] + step[k], p->low[k]), p->high[k]);
    const sdm_pose turn = {.rotation = {step[n], step[n + 1], step[n + 2]}};
    double r[9];
    sdm_pose_matrix(&turn, r);
    sdm_rotation_product(r, from->rotation, to->rotation);
    for (size_t k = 0; k < 3; k++) to->translation[k] += step[fit_at_translation(n) + k];
    to->blur += step[fit_at_blur(n)];
    for (size_t i = 0; fit_columns(n) + i < p->sums.n_unknowns; i++) {
        sdm_fit_law *t =
            i < to->look.n_inside ? &to->look.inside[i] : &to->look.outside[i - to->look.n_inside];
        t->mean += step[fit_columns(n) + i];
    }
}

static void set_limits(const fit_problem *p, const fit_run *run, fit_limits *l)
{
    const size_t n = p->n_params;
    const fit_state *s = &p->state;
    for (size_t i = 0; i < p->sums.n_unknowns; i++) {
        l->least[i] = -INFINITY, l->most[i] = INFINITY;
        l->kept[i] = i < n       ? run->keep_params
                     : i < n + 6 ? run->keep_pose
                     : i > n + 6 ? run->keep_look || fit_mean_stays(p, i)
                                 : false;
    }
    for (size_t k = 0; k < n; k++) {
        const double most = STEP_MOST * (p->high[k] - p->low[k]);
        l->least[k] = fmax(p->low[k] - s->params[k], -most);
        l->most[k] = fmin(p->high[k] - s->params[k], most);
    }
    const size_t blur = fit_at_blur(n);
    l->kept[blur] = run->keep_blur || !p->maps.share;
    l->least[blur] = fmax(p->maps.least_blur - s->blur, -0.5 * s->blur);
    l->most[blur] = fmin(0.5 * s->blur, fmax(p->extent.reach - s->blur, 0));
}

// the largest of what sdm_fit_opts.eps counts
static double step_size(const fit_problem *p, const double *step)
{
    double most = 0;
    for (size_t k = 0; k < p->n_params; k++)
        most = fmax(most, fabs(step[k]) / (p->high[k] - p->low[k]));
    for (size_t k = 0; k < 3; k++) {
        most = fmax(most, fabs(step[fit_at_rotation(p->n_params) + k]));
        most = fmax(most, fabs(step[fit_at_translation(p->n_params) + k]) / p->extent.reach);
    }
    return most;
}

static bool find_step(const fit_problem *p, const fit_run *run, double damping, bool observed,
                      double *step, double *work)
{
    const size_t n = p->sums.n_unknowns;
    double gradient[FIT_UNKNOWNS_MAX], *a = work;
    memcpy(gradient, p->sums.gradient, n * sizeof *gradient);
    memcpy(a, observed ? p->sums.observed : p->sums.complete, n * n * sizeof *a);
    (void)sdm_fit_prior(p, &p->state, gradient, a, NULL);
    sdm_fit_add_ignorance(p, a);
    fit_limits limits;
    set_limits(p, run, &limits);
    if (!sdm_fit_step(n, a, gradient, damping, &limits, step, work + n * n)) return false;
    const double size = step_size(p, step);
    const double factor = size > STEP_MOST ? STEP_MOST / size : 1;
    for (size_t i = 0; i < n; i++) step[i] *= factor;
    return true;
}

static double expected_gain(const fit_problem *p, const double *step)
{
    double gradient[FIT_UNKNOWNS_MAX], sum = 0;
    memcpy(gradient, p->sums.gradient, p->sums.n_unknowns * sizeof *gradient);
    (void)sdm_fit_prior(p, &p->state, gradient, NULL, NULL);
    for (size_t i = 0; i < p->sums.n_unknowns; i++) sum += gradient[i] * step[i];
    return sum;
}

static void swap_sums(fit_problem *p)
{
    const fit_sums kept = p->sums;
    p->sums = p->trial;
    p->trial = kept;
}

/* Where the steps of an iteration stand. */
typedef struct fit_pace {
    double damping;
    int flat; // steps in a row whose gain was too small to tell
} fit_pace;

// moves by a step; *gained is false where that does not gain, and the state is as before but for
// its maps
static sdm_status try_step(fit_problem *p, const double *step, fit_pace *pace, bool *gained,
                           sdm_error *err)
{
    const double before = p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    const double expected = expected_gain(p, step);
    const fit_state from = p->state;
    sdm_fit_move(p, &from, step, &p->state);
    swap_sums(p);
    const sdm_status s = sdm_fit_look(p, err);
    if (s) return s;
    const double after = p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    const double least = fmax(p->sums.rounding, GAIN_LEAST * p->noise_factor);
    const bool flat = fabs(expected) < least;
    *gained = after > before || (flat && after > before - 2 * least);
    pace->flat = flat ? pace->flat + *gained : 0;
    if (*gained) return SDM_OK;
    p->state = from;
    swap_sums(p);
    return SDM_OK;
}

/* One step that gains; *taken is false where none does. */
static sdm_status one_step(fit_problem *p, const fit_run *run, fit_pace *pace, double *step,
                           double *work, bool *taken, sdm_error *err)
{
    bool observed = true;
    *taken = false;
    for (double *damping = &pace->damping; *damping <= DAMPING_MOST;
         *damping = fmax(10 * *damping, 1e-3)) {
        if (observed) observed = find_step(p, run, *damping, true, step, work);
        if (!observed && !find_step(p, run, *damping, false, step, work)) continue;
        const sdm_status s = try_step(p, step, pace, taken, err);
        if (s) return s;
        if (*taken) {
            *damping = *damping > 1e-6 ? *damping / 10 : 0;
            return SDM_OK;
        }
        observed = false;
    }
    return sdm_fit_look(p, err); // maps and samples of the state that is kept
}

/* Steps near the maximum: what is left out of the information, and the tissues, which wait for the
   shape, make them converge linearly, and slowly where tissues overlap. They are accelerated
   together. */
typedef struct fit_rush {
    fit_mixing mixing;
    size_t n_look;
    double place[FIT_UNKNOWNS_MAX]; // the way so far, in units
    double from[FIT_LOOK_MAX];      // numbers of the tissues before they were estimated
    double to[FIT_MIXING_MAX];      // where an accelerated step leads, tissues last
} fit_rush;

// what unknowns are measured in
static double unit_of(const fit_problem *p, size_t i)
{
    const size_t n = p->n_params;
    const sdm_fit_appearance *a = &p->opts->appearance;
    if (i < n) return p->high[i] - p->low[i];
    if (i < fit_at_translation(n)) return 1;
    if (i <= fit_at_blur(n)) return p->extent.reach;
    return fabs(a->inside[0].mean - a->outside[0].mean);
}

// replaces a plain step by an accelerated one, within the limits
static void accelerate(const fit_problem *p, const fit_run *run, fit_rush *r, double *step)
{
    const size_t n = p->sums.n_unknowns;
    double at[FIT_MIXING_MAX];
    for (size_t i = 0; i < n; i++) {
        at[i] = r->place[i];
        r->to[i] = at[i] + step[i] / unit_of(p, i);
    }
    for (size_t i = 0; i < r->n_look; i++) at[n + i] = r->from[i];
    (void)sdm_fit_look_numbers(p, r->to + n);
    double largest = 0;
    for (size_t i = 0; i < n + r->n_look; i++) largest = fmax(largest, fabs(r->to[i] - at[i]));
    if (run->averaged) // their slope jumps: the last step alone says something, and not for long
        sdm_fit_mix(&r->mixing, 1, n + r->n_look, at, r->to,
                    fmin(RUSH_MOST, RUSH_AVERAGED * largest));
    else
        sdm_fit_mix(&r->mixing, FIT_MIXING_DEPTH, n + r->n_look, at, r->to, RUSH_MOST);
    fit_limits limits;
    set_limits(p, run, &limits);
    for (size_t i = 0; i < n; i++)
        step[i] = limits.kept[i] ? 0
                                 : fmin(fmax((r->to[i] - at[i]) * unit_of(p, i), limits.least[i]),
                                        limits.most[i]);
}

// what a step that was taken means for the next acceleration
static void rushed(fit_problem *p, const fit_run *run, fit_rush *r, const double *step)
{
    for (size_t i = 0; i < p->sums.n_unknowns; i++) r->place[i] += step[i] / unit_of(p, i);
    if (!run->keep_look) sdm_fit_look_set(p, r->to + p->sums.n_unknowns);
}

/* An accelerated step; *size: that of the plain one, how far the maximum is. *taken is false where
 * it does not gain. */
static sdm_status rush(fit_problem *p, const fit_run *run, fit_rush *r, fit_pace *pace,
                       double *step, double *work, double *size, bool *taken, sdm_error *err)
{
    *taken = false;
    if (!find_step(p, run, 0, true, step, work)) return SDM_OK;
    *size = step_size(p, step);
    accelerate(p, run, r, step);
    const sdm_status s = try_step(p, step, pace, taken, err);
    if (!s && *taken) rushed(p, run, r, step);
    return s;
}

/* The same by averaged derivatives. Whether it gains is not asked: it may go beyond the kink that
 * is the maximum. */
static sdm_status average_step(fit_problem *p, const fit_run *run, fit_rush *r, double *step,
                               double *work, double *size, bool *taken, sdm_error *err)
{
    sdm_status s = sdm_fit_average_gradient(p, run->way, err);
    if (s) return s;
    *taken = find_step(p, run, 0, true, step, work) || find_step(p, run, 0, false, step, work);
    if (!*taken) return SDM_OK;
    *size = step_size(p, step);
    accelerate(p, run, r, step);
    const fit_state from = p->state;
    sdm_fit_move(p, &from, step, &p->state);
    s = sdm_fit_look(p, err);
    if (!s) rushed(p, run, r, step);
    return s;
}

static sdm_status record(fit_problem *p, const fit_run *run, double step, sdm_error *err)
{
    const double objective = p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
    p->n_steps++;
    if (p->opts->progress) {
        sdm_fit_progress g = {.phase = run->phase,
                              .iteration = p->n_steps,
                              .objective = objective,
                              .step = step,
                              .params = p->state.params};
        sdm_rotation_vector(p->state.rotation, g.pose.rotation);
        memcpy(g.pose.translation, p->state.translation, sizeof g.pose.translation);
        p->opts->progress(p->opts->user, &g);
    }
    if (run->phase == SDM_FIT_SEARCH) return SDM_OK;
    if (p->n_iterations == p->objective_capacity) {
        const size_t now = 2 * p->objective_capacity + 16;
        const sdm_status s = sdm_grow((void **)&p->objective, p->objective_capacity, now,
                                      sizeof *p->objective, "history of the fit", err);
        if (s) return s;
        p->objective_capacity = now;
    }
    p->objective[p->n_iterations++] = objective;
    return SDM_OK;
}

sdm_status sdm_fit_iterate(fit_problem *p, const fit_run *run, fit_ended *out, sdm_error *err)
{
    const size_t n = p->sums.n_unknowns;
    double step[FIT_UNKNOWNS_MAX], *work = NULL;
    fit_rush quick = {0};
    fit_pace pace = {.damping = run->phase == SDM_FIT_SEARCH ? 1e-2 : 1e-4};
    double way_before = INFINITY;
    *out = (fit_ended){.step = INFINITY};
    sdm_status s = SDM_ALLOC(&work, 3 * n * n, "matrices of the fit", err);
    if (!s) s = sdm_fit_look(p, err);
    for (size_t i = 0; i < run->max_iterations && !s && !out->converged; i++) {
        quick.n_look = run->keep_look ? 0 : sdm_fit_look_numbers(p, quick.from);
        if (!run->keep_look) s = sdm_fit_look_update(p, err);
        if (s) break;
        bool taken = false;
        double size = INFINITY;
        if (run->averaged)
            s = average_step(p, run, &quick, step, work, &size, &taken, err);
        else if (out->step <= STEP_RUSHED)
            s = rush(p, run, &quick, &pace, step, work, &size, &taken, err);
        if (!s && !taken && !run->averaged) {
            quick.mixing.count = 0;
            s = one_step(p, run, &pace, step, work, &taken, err);
            // with much damping the size of a step says nothing of how far the maximum is
            if (taken && (pace.damping <= DAMPING_TRUE || !isfinite(size)))
                size = step_size(p, step);
        }
        if (s) break;
        if (!taken) {
            // nowhere to go: a maximum to rounding, or derivatives that do not fit
            out->converged = out->step <= 1e3 * run->eps;
            break;
        }
        const double way = step_size(p, step);
        const bool steep =
            run->averaged && size <= STEEP_MOST * run->eps && fmax(way, way_before) <= run->eps;
        way_before = way;
        out->step = steep ? way : size;
        out->converged =
            steep || (size <= run->eps && (run->averaged || pace.damping <= DAMPING_TRUE));
        out->rough = !out->converged && run->flat_most > 0 && pace.flat >= run->flat_most;
        out->converged = out->converged || out->rough;
        s = record(p, run, out->step, err);
    }
    sdm_free(work);
    return s;
}
