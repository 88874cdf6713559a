/* Newton's method with damping (Levenberg 1944, Marquardt 1963). It uses the observed information
 * where that is positive definite, else the complete one; the step is then that of
 * expectation-maximisation (Louis 1982). */
#include "newton.h"

#include <math.h>
#include <string.h>

#include "anderson.h"
#include "averaged_gradient.h"
#include "objective.h"
#include "open_motions.h"
#include "prior.h"
#include "recent.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "solve.h"
#include "tissues.h"

// largest step of one iteration: of a parameter as a share of its range, of the rotation in rad, of
// the translation as a share of the shape's reach
#define STEP_MAX 0.25
// Negligible gain in log-likelihood of independent samples (a step of a few hundredths of a sd);
// multiplied by the noise factor for correlated ones. A step whose predicted gain is below this, or
// below rounding errors, is "flat": it is accepted unless the objective clearly drops.
#define GAIN_MIN 1e-3
// Without such a gain in this number of iterations they go round, as two steps may that cross a
// kink of the likelihood to and fro: one whose predicted gain is negligible, and one that is
// damped.
#define IDLE_MAX 8
// the search for a damped step gives up above this factor
#define DAMPING_MAX 1e8
// above this damping the size of a step does not tell the distance to the maximum
#define DAMPING_SMALL 0.1
// Acceleration starts when steps are smaller than this; it changes no unknown by more than
// ACCELERATION_MAX units (see unknown_unit()).
#define ACCELERATED_BELOW 0.01
#define ACCELERATION_MAX 0.1
// With averaged gradients near a kink, accelerated steps converge but plain Newton steps stall at a
// few times eps: accept up to STEEP_MAX * eps.
#define STEEP_MAX 10.0
// averaged gradients: an acceleration changes no unknown by more than this factor times the largest
// component of the plain step
#define ACCELERATION_FACTOR 4.0
// averaged gradients of points: a step that loses more log-likelihood is halved, so many times at
// most
#define DROP_MAX 1.0
#define HALVINGS_MAX 8
// Averaged steps of points swing where an unknown goes to and fro by more than SWING_MAX of its
// standard deviation, and by no less than SWING_SAME times as much as FIT_RECENT steps before. They
// are then scaled down until they swing by no more than SWING_RELAXED, to RELAXATION_MIN of their
// size at least.
#define SWING_MAX 0.1
#define SWING_SAME 0.9
#define SWING_RELAXED 0.05
#define RELAXATION_MIN (1.0 / 64)

void sdm_fit_state_move(const fit_problem *p, const fit_state *from, const double *step,
                        fit_state *to)
{
    const size_t n = p->n_params;
    *to = *from;
    for (size_t k = 0; k < n; k++)
        to->params[k] = fmin(fmax(from->params[k] + step[k], p->low[k]), p->high[k]);
    const sdm_pose turn = {.rotation = {step[n], step[n + 1], step[n + 2]}};
    double r[9];
    sdm_pose_matrix(&turn, r);
    m3_product(r, from->rotation, to->rotation);
    for (size_t k = 0; k < 3; k++) to->translation[k] += step[fit_at_translation(n) + k];
    to->blur += step[fit_at_blur(n)];
    for (size_t i = 0; fit_columns(n) + i < p->information.n_unknowns; i++) {
        sdm_fit_law *t = i < to->appearance.n_inside
                             ? &to->appearance.inside[i]
                             : &to->appearance.outside[i - to->appearance.n_inside];
        t->mean += step[fit_columns(n) + i];
    }
}

// sets the limits of the next step from the unknowns that are kept, the bounds, and the largest
// steps
static void limits_set(const fit_problem *p, const fit_newton_opts *opts, fit_limits *l)
{
    const size_t n = p->n_params;
    const fit_state *s = &p->state;
    for (size_t i = 0; i < p->information.n_unknowns; i++) {
        l->min[i] = -INFINITY, l->max[i] = INFINITY;
        l->kept[i] = i < n       ? opts->keep_params || fit_param_is_kept(p, i)
                     : i < n + 6 ? opts->keep_pose
                     : i > n + 6 ? opts->keep_appearance || fit_mean_is_kept(p, i)
                                 : false;
    }
    for (size_t k = 0; k < n; k++) {
        const double most = STEP_MAX * (p->high[k] - p->low[k]);
        l->min[k] = fmax(p->low[k] - s->params[k], -most);
        l->max[k] = fmin(p->high[k] - s->params[k], most);
    }
    const size_t blur = fit_at_blur(n);
    l->kept[blur] = opts->keep_blur || !p->maps.share;
    l->min[blur] = fmax(p->maps.min_blur - s->blur, -0.5 * s->blur);
    l->max[blur] = fmin(0.5 * s->blur, fmax(p->extent.reach - s->blur, 0));
}

// largest component of a step, in the units of sdm_fit_opts.eps
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

// gradient[n] and negative second derivatives a[n][n] of the quadratic model
static void equations_set(const fit_problem *p, bool observed, double *gradient, double *a)
{
    const size_t n = p->information.n_unknowns;
    memcpy(gradient, p->information.gradient, n * sizeof *gradient);
    memcpy(a, observed ? p->information.observed : p->information.complete, n * n * sizeof *a);
    (void)sdm_fit_prior(p, &p->state, gradient, a, NULL);
    sdm_fit_add_weak_prior(p, a);
    sdm_fit_open_motions_stop(p, a);
}

// step[n] that maximises the quadratic model within the limits; observed: use the observed
// information, else the complete one. work: 3 n n numbers. False: the information is not positive
// definite
static bool step_find(const fit_problem *p, const fit_newton_opts *opts, double damping,
                      bool observed, double *step, double *work)
{
    const size_t n = p->information.n_unknowns;
    double gradient[FIT_UNKNOWNS_MAX], *a = work;
    equations_set(p, observed, gradient, a);
    fit_limits limits;
    limits_set(p, opts, &limits);
    if (!sdm_fit_bounded_step(n, a, gradient, damping, &limits, step, work + n * n)) return false;
    const double size = step_size(p, step);
    const double factor = size > STEP_MAX ? STEP_MAX / size : 1;
    for (size_t i = 0; i < n; i++) step[i] *= factor;
    return true;
}

// gain in the objective by a step, to first order
static double expected_gain(const fit_problem *p, const double *step)
{
    double gradient[FIT_UNKNOWNS_MAX], sum = 0;
    memcpy(gradient, p->information.gradient, p->information.n_unknowns * sizeof *gradient);
    (void)sdm_fit_prior(p, &p->state, gradient, NULL, NULL);
    for (size_t i = 0; i < p->information.n_unknowns; i++) sum += gradient[i] * step[i];
    return sum;
}

// An upper bound of the change of any unknown by an undamped step, in its standard deviations: by
// Cauchy and Schwarz the gradient times the step, for correlated samples.
static double deviations_of(const fit_problem *p, const double *step)
{
    return sqrt(fmax(expected_gain(p, step), 0) / p->noise_factor);
}

// swaps the information of state and trial
static void information_swap(fit_problem *p)
{
    const fit_information kept = p->information;
    p->information = p->trial;
    p->trial = kept;
}

/* A step that was tried. */
typedef struct fit_try {
    /* false: there is none, or the objective dropped */
    bool taken;
    /* size of the undamped step, an estimate of the distance to the maximum, as step_size(); the
     * same in standard deviations: no unknown moves by more of its own */
    double size, deviations;
} fit_try;

/* Damping of the steps. */
typedef struct fit_damping {
    /* the diagonal of the information is multiplied by 1 + factor */
    double factor;
    /* flat steps in a row, see GAIN_MIN */
    int flat;
} fit_damping;

// gains below this are negligible
static double least_gain(const fit_problem *p)
{
    return fmax(p->information.rounding, GAIN_MIN * p->noise_factor);
}

// Moves by a step and evaluates. *gained = false: the objective dropped; state and information are
// restored, but maps and samples stay those of the trial.
static sdm_status step_try(fit_problem *p, const double *step, fit_damping *d, bool *gained,
                           sdm_error *err)
{
    const double before = sdm_fit_objective(p);
    const double expected = expected_gain(p, step);
    const fit_state from = p->state;
    sdm_fit_state_move(p, &from, step, &p->state);
    information_swap(p);
    const sdm_status s = sdm_fit_evaluate(p, err);
    if (s) return s;
    const double after = sdm_fit_objective(p);
    const double least = least_gain(p);
    const bool flat = fabs(expected) < least;
    *gained = after > before || (flat && after > before - 2 * least);
    d->flat = flat ? d->flat + *gained : 0;
    if (*gained) return SDM_OK;
    p->state = from;
    information_swap(p);
    return SDM_OK;
}

/* Increases the damping until a step raises the objective; then reduces it for the next step.
 * *taken = false: no damping helps; the state is unchanged and evaluated. */
static sdm_status damped_step(fit_problem *p, const fit_newton_opts *opts, fit_damping *d,
                              double *step, double *work, bool *taken, sdm_error *err)
{
    bool observed = true;
    *taken = false;
    for (double *damping = &d->factor; *damping <= DAMPING_MAX;
         *damping = fmax(10 * *damping, 1e-3)) {
        if (observed) observed = step_find(p, opts, *damping, true, step, work);
        if (!observed && !step_find(p, opts, *damping, false, step, work)) continue;
        const sdm_status s = step_try(p, step, d, taken, err);
        if (s) return s;
        if (*taken) {
            *damping = *damping > 1e-6 ? *damping / 10 : 0;
            return SDM_OK;
        }
        observed = false;
    }
    // restore maps and samples
    return sdm_fit_evaluate(p, err);
}

/* Anderson acceleration of the steps near the maximum. Plain steps converge only linearly, because
 * the information is approximate and tissues are re-estimated in turn with the shape; slowly where
 * tissues overlap. Unknowns and appearance are accelerated together as one vector. */
typedef struct fit_acceleration {
    fit_anderson anderson;
    /* how many numbers of the vector describe the appearance; 0: the appearance is kept */
    size_t n_appearance;
    /* sum of all steps, in the units of unknown_unit() */
    double position[FIT_UNKNOWNS_MAX];
    /* appearance before its latest re-estimation */
    double from[FIT_APPEARANCE_MAX];
    /* end of the accelerated step: unknowns, then appearance */
    double to[FIT_ANDERSON_MAX];
} fit_acceleration;

// unit of an unknown in the accelerated vector: range, 1 rad, reach of the shape, contrast of the
// image
static double unknown_unit(const fit_problem *p, size_t i)
{
    const size_t n = p->n_params;
    const sdm_fit_appearance *a = &p->opts->appearance;
    if (i < n) return p->high[i] - p->low[i];
    if (i < fit_at_translation(n)) return 1;
    if (i <= fit_at_blur(n)) return p->extent.reach;
    return fabs(a->inside[0].mean - a->outside[0].mean);
}

// replaces a plain step by the accelerated one, clamped to the limits
static void step_accelerate(const fit_problem *p, const fit_newton_opts *opts, fit_acceleration *r,
                            double *step)
{
    const size_t n = p->information.n_unknowns;
    // the point before the plain step, and (r->to) the point to which the plain step leads
    double at[FIT_ANDERSON_MAX];
    for (size_t i = 0; i < n; i++) {
        at[i] = r->position[i];
        r->to[i] = at[i] + step[i] / unknown_unit(p, i);
    }
    for (size_t i = 0; i < r->n_appearance; i++) at[n + i] = r->from[i];
    (void)sdm_fit_appearance_pack(p, r->to + n);
    double largest = 0;
    for (size_t i = 0; i < n + r->n_appearance; i++)
        largest = fmax(largest, fabs(r->to[i] - at[i]));
    // with the averaged gradient the fixed-point function jumps from step to step, so only the last
    // pair is used, and the change is limited
    if (opts->averaged)
        sdm_fit_anderson_mix(&r->anderson, 1, n + r->n_appearance, at, r->to,
                             fmin(ACCELERATION_MAX, ACCELERATION_FACTOR * largest));
    else
        sdm_fit_anderson_mix(&r->anderson, FIT_ANDERSON_DEPTH, n + r->n_appearance, at, r->to,
                             ACCELERATION_MAX);
    // back to a step, within the limits
    fit_limits limits;
    limits_set(p, opts, &limits);
    for (size_t i = 0; i < n; i++)
        step[i] =
            limits.kept[i]
                ? 0
                : fmin(fmax((r->to[i] - at[i]) * unknown_unit(p, i), limits.min[i]), limits.max[i]);
}

// after an accelerated step: advances the position and accepts the accelerated appearance
static void acceleration_advance(fit_problem *p, const fit_newton_opts *opts, fit_acceleration *r,
                                 const double *step)
{
    for (size_t i = 0; i < p->information.n_unknowns; i++)
        r->position[i] += step[i] / unknown_unit(p, i);
    if (!opts->keep_appearance) sdm_fit_appearance_unpack(p, r->to + p->information.n_unknowns);
}

/* One accelerated step. *out describes the plain step. */
static sdm_status accelerated_step(fit_problem *p, const fit_newton_opts *opts, fit_acceleration *r,
                                   fit_damping *d, double *step, double *plain, double *work,
                                   fit_try *out, sdm_error *err)
{
    if (!step_find(p, opts, 0, true, step, work)) return SDM_OK;
    out->size = step_size(p, step);
    out->deviations = deviations_of(p, step);
    memcpy(plain, step, p->information.n_unknowns * sizeof *plain);
    step_accelerate(p, opts, r, step);
    const sdm_status s = step_try(p, step, d, &out->taken, err);
    if (!s && out->taken) acceleration_advance(p, opts, r, step);
    return s;
}

/* Moves by a step with the averaged gradient and evaluates. The objective may drop a little: the
 * step may cross the kink that is the maximum. Where it drops further, the difference quotients of
 * points mislead: *step is halved until it does not. *whole: it was not halved. */
static sdm_status averaged_move(fit_problem *p, double *step, bool *whole, sdm_error *err)
{
    const fit_state from = p->state;
    const double least = sdm_fit_objective(p) - DROP_MAX;
    *whole = true;
    for (int halving = 0;; halving++) {
        sdm_fit_state_move(p, &from, step, &p->state);
        const sdm_status s = sdm_fit_evaluate(p, err);
        if (s || !fit_maps_direct(&p->maps) || sdm_fit_objective(p) >= least ||
            halving == HALVINGS_MAX)
            return s;
        for (size_t i = 0; i < p->information.n_unknowns; i++) step[i] *= 0.5;
        *whole = false;
    }
}

/* Relaxation of averaged steps of points. Where the gradient falls steeply across a kink, full
 * steps lead from one side to the other and back, or round several kinks. Steps that are scaled
 * down come to rest between them. */
typedef struct fit_relaxation {
    /* the steps are scaled by this; 1: they are full and accelerated */
    double factor;
    /* number of averaged steps */
    size_t n;
    /* largest swing in the FIT_RECENT steps before the last n % FIT_RECENT ones, in standard
     * deviations */
    double swing;
} fit_relaxation;

// the largest movement moves() of an unknown in the last steps, in standard deviations by the
// quadratic model; 0 where these are unknown. work: 4 n n numbers
static double largest_movement(const fit_problem *p, const fit_newton_opts *opts,
                               double (*moves)(const fit_problem *p, size_t i), double *work)
{
    const size_t n = p->information.n_unknowns;
    double gradient[FIT_UNKNOWNS_MAX], most = 0, *inverse = work + n * n;
    fit_limits limits;
    bool known = false;
    limits_set(p, opts, &limits);
    for (int complete = 0; complete < 2 && !known; complete++) {
        equations_set(p, !complete, gradient, work);
        known = sdm_fit_inverse(n, work, limits.kept, inverse, inverse + n * n);
    }
    for (size_t i = 0; i < p->n_params + 6 && known; i++) {
        const double sd = sqrt(inverse[i * (n + 1)] * p->noise_factor);
        if (sd > 0) most = fmax(most, moves(p, i) / sd);
    }
    return most;
}

// after an averaged step: scales the next ones down while they swing; whether those that are scaled
// down have come to rest
static bool relaxation_adapt(const fit_problem *p, const fit_newton_opts *opts, fit_relaxation *x,
                             double *work)
{
    if (++x->n % FIT_RECENT) return false;
    const double before = x->swing;
    x->swing = largest_movement(p, opts, sdm_fit_swing, work);
    const bool lasts = before > SWING_MAX && x->swing > fmax(SWING_MAX, SWING_SAME * before),
               relaxed = x->factor < 1;
    if (relaxed && largest_movement(p, opts, sdm_fit_unrest, work) <= SWING_RELAXED) return true;
    if ((lasts || (relaxed && x->swing > SWING_RELAXED)) && x->factor > RELAXATION_MIN)
        x->factor *= 0.5;
    return false;
}

/* One step with the averaged gradient, accelerated unless it is scaled down by `relaxed` < 1. */
static sdm_status averaged_step(fit_problem *p, const fit_newton_opts *opts, fit_acceleration *r,
                                double relaxed, double *step, double *plain, double *work,
                                fit_try *out, sdm_error *err)
{
    sdm_status s = sdm_fit_average_gradient(p, err);
    if (s) return s;
    out->taken =
        step_find(p, opts, 0, true, step, work) || step_find(p, opts, 0, false, step, work);
    if (!out->taken) return SDM_OK;
    out->size = step_size(p, step);
    out->deviations = deviations_of(p, step);
    memcpy(plain, step, p->information.n_unknowns * sizeof *plain);
    const bool accelerated = !(relaxed < 1);
    bool whole;
    if (accelerated) step_accelerate(p, opts, r, step);
    for (size_t i = 0; i < p->information.n_unknowns && !accelerated; i++) step[i] *= relaxed;
    s = averaged_move(p, step, &whole, err);
    if (!s && accelerated && whole) acceleration_advance(p, opts, r, step);
    if (!whole) r->anderson.count = 0;
    return s;
}

void sdm_fit_tell_progress(const fit_problem *p, sdm_fit_phase phase, double step)
{
    if (!p->opts->progress) return;
    sdm_fit_progress g = {.phase = phase,
                          .iteration = p->n_steps,
                          .objective = sdm_fit_objective(p),
                          .step = step,
                          .params = p->state.params,
                          .round = p->search_round,
                          .start = p->search_start,
                          .n_starts = p->search_starts,
                          .best_params = p->search_best,
                          .refused_by = p->refused_by};
    sdm_rotation_vector(p->state.rotation, g.pose.rotation);
    memcpy(g.pose.translation, p->state.translation, sizeof g.pose.translation);
    p->opts->progress(p->opts->user, &g);
}

// reports an iteration and, except in the search, stores its objective
static sdm_status iteration_record(fit_problem *p, const fit_newton_opts *opts, double step,
                                   sdm_error *err)
{
    p->n_steps++;
    sdm_fit_tell_progress(p, opts->phase, step);
    if (opts->phase == SDM_FIT_SEARCH) return SDM_OK;
    if (p->n_iterations == p->objective_capacity) {
        const size_t now = 2 * p->objective_capacity + 16;
        const sdm_status s = sdm_grow((void **)&p->objective, p->objective_capacity, now,
                                      sizeof *p->objective, "history of the fit", err);
        if (s) return s;
        p->objective_capacity = now;
    }
    p->objective[p->n_iterations++] = sdm_fit_objective(p);
    return SDM_OK;
}

sdm_status sdm_fit_newton(fit_problem *p, const fit_newton_opts *opts, fit_newton_end *out,
                          sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    double step[FIT_UNKNOWNS_MAX], plain[FIT_UNKNOWNS_MAX], *work = NULL;
    fit_acceleration acceleration = {0};
    fit_relaxation relaxation = {.factor = 1};
    fit_damping damping = {.factor = opts->phase == SDM_FIT_SEARCH ? 1e-2 : 1e-4};
    double taken_before = INFINITY, best = -INFINITY;
    int idle = 0; // small steps since the objective last rose by more than a negligible gain
    *out = (fit_newton_end){.step = INFINITY};
    sdm_status s = SDM_ALLOC(&work, 4 * n * n, "matrices of the fit", err);
    if (!s) s = sdm_fit_evaluate(p, err);
    for (size_t i = 0; i < opts->max_iterations && !s && !out->converged && !out->at_rest; i++) {
        // tissues
        acceleration.n_appearance =
            opts->keep_appearance ? 0 : sdm_fit_appearance_pack(p, acceleration.from);
        if (!opts->keep_appearance) s = sdm_fit_appearance_update(p, err);
        if (s) break;
        // unknowns: an accelerated step near the maximum, a damped one otherwise
        bool undamped = true;
        fit_try t = {.size = INFINITY, .deviations = INFINITY};
        if (opts->averaged)
            s = averaged_step(p, opts, &acceleration, relaxation.factor, step, plain, work, &t,
                              err);
        else if (out->step <= ACCELERATED_BELOW)
            s = accelerated_step(p, opts, &acceleration, &damping, step, plain, work, &t, err);
        if (!s && !t.taken && !opts->averaged) {
            acceleration.anderson.count = 0;
            s = damped_step(p, opts, &damping, step, work, &t.taken, err);
            // with much damping the size of a step does not tell the distance to the maximum
            if (t.taken && (damping.factor <= DAMPING_SMALL || !isfinite(t.size)))
                t.size = step_size(p, step);
            undamped = damping.factor <= DAMPING_SMALL;
            memcpy(plain, step, n * sizeof *plain);
        }
        if (s) break;
        if (!t.taken) {
            // no step gains: this is the maximum up to rounding, or the derivatives do not match
            // the objective
            out->converged = out->step <= 1e3 * opts->eps;
            break;
        }
        // converged?
        sdm_fit_remember(p, step, undamped ? plain : NULL);
        const double taken_size = step_size(p, step) / relaxation.factor;
        const bool steep = opts->averaged && t.size <= STEEP_MAX * opts->eps &&
                           fmax(taken_size, taken_before) <= opts->eps;
        taken_before = taken_size;
        out->step = steep ? taken_size : t.size;
        out->converged =
            steep || (t.size <= opts->eps && (opts->averaged || damping.factor <= DAMPING_SMALL));
        out->small = !out->converged && opts->eps_sd > 0 && t.deviations <= opts->eps_sd;
        const double objective = sdm_fit_objective(p);
        const bool gained = objective > best + least_gain(p);
        idle = gained || !(out->step <= ACCELERATED_BELOW) ? 0 : idle + 1;
        if (gained) best = objective;
        out->flat = !out->converged && !out->small && opts->max_flat > 0 &&
                    (damping.flat >= opts->max_flat || idle >= IDLE_MAX);
        out->converged = out->converged || out->small || out->flat;
        out->at_rest = opts->averaged && fit_maps_direct(&p->maps) && !out->converged &&
                       relaxation_adapt(p, opts, &relaxation, work);
        s = iteration_record(p, opts, out->step, err);
    }
    sdm_free(work);
    return s;
}
