/* A fit from beginning to end: run(), near the end of this file, lists its steps in order. */
#include "sdm/fit.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fit/data/blur.h"
#include "fit/data/cavity.h"
#include "fit/data/soft_labels.h"
#include "fit/data/source_params.h"
#include "fit/judge/judgement.h"
#include "fit/judge/next_pose.h"
#include "fit/kept/kept_params.h"
#include "fit/kept/kept_pose.h"
#include "fit/solver/averaged_gradient.h"
#include "fit/solver/between.h"
#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "fit/solver/prior.h"
#include "fit/solver/tissue_field.h"
#include "fit/solver/tissues.h"
#include "fit/start/even_points.h"
#include "fit/start/other_values.h"
#include "fit/start/start_search.h"
#include "fit/trust/convergence.h"
#include "fit/trust/evidence.h"
#include "fit/trust/flat_params.h"
#include "fit/trust/pose_params.h"
#include "fit/trust/posterior.h"
#include "fit_check.h"
#include "fit_rival.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/rotation.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"

// largest number of rounds in which region, prior weights and state are brought into agreement
#define ROUNDS_MAX 8
// largest number of samples; with more voxels the stride doubles
#define SAMPLES_MAX 2000000
// eps of the rounds in which the region and the prior weights may still change: of plain Newton
// steps, and of steps with the averaged gradient
#define EPS_FIRST 1e-2
#define EPS_FIRST_AVERAGED 1e-4
// A fit that only serves to judge another one ends its steps with the averaged gradient at this
// eps, unless the options give a larger one.
#define EPS_RIVAL 1e-3
// relative changes of the prior weights up to this size are ignored: always; where flat steps ended
// the iterations
#define WEIGHT_EPS 1e-3
#define WEIGHT_ROUGH 0.05
// plain steps up to this size are followed by steps with the averaged gradient, in units of
// sdm_fit_opts.eps
#define STEP_NEAR 1e-2
// the same: a second grid may yet end the iterations
#define STEP_BETWEEN 0.1
// number of flat steps (of negligible predicted gain) in a row that ends the iterations with a
// network's maps
#define FLAT_MAX 6
// a second fit to points replaces the first one if it gains this much log-likelihood
#define GAIN_EVEN 1.0
// share of outliers among points at the start
#define OUTLIERS_FIRST 0.1
// Largest number of times that the priors are reweighted. Without a limit a prior that contradicts
// the image could reinforce itself: a worse fit has more correlated residuals, which strengthen the
// prior.
#define WEIGHINGS_MAX 4

void sdm_fit_dispose(sdm_fit_result *r)
{
    sdm_free(r->params);
    sdm_free(r->covariance);
    sdm_free(r->sd);
    sdm_free(r->correlation);
    sdm_free(r->at_bound);
    sdm_free(r->by_prior);
    sdm_free(r->prior_sd);
    sdm_free(r->objective);
    *r = (sdm_fit_result){0};
}

// allocates the arrays of the result; numbers that a fit may leave undetermined start as NaN
static sdm_status result_create(size_t n, sdm_fit_result *out, sdm_error *err)
{
    const size_t size = n + 6;
    out->n_params = n;
    out->log_likelihood_without = out->evidence = NAN;
    out->inside_share = out->noise_factor = out->model_error_mm = out->network_error_sd = NAN;
    out->advised_voxel_mm = NAN;
    sdm_status s = SDM_ALLOC(&out->params, n, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->covariance, size * size, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->sd, size, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->correlation, size * size, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->at_bound, n, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->by_prior, n, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->prior_sd, n, "result of the fit", err);
    for (size_t i = 0; i < size * size && !s; i++) out->covariance[i] = out->correlation[i] = NAN;
    for (size_t i = 0; i < size && !s; i++) out->sd[i] = NAN;
    for (int i = 0; i < 6; i++) out->pose_sd_determined[i] = NAN;
    return s;
}

static void problem_dispose(fit_problem *p)
{
    sdm_fit_maps_dispose(&p->maps);
    sdm_fit_samples_dispose(&p->samples);
    sdm_fit_information_dispose(&p->information);
    sdm_fit_information_dispose(&p->trial);
    sdm_free(p->objective);
}

// start values of the parameters, checked against their bounds or clamped to them
static sdm_status params_start(fit_problem *p, bool *clamped, sdm_error *err)
{
    const sdm_fit_source *source = p->source;
    for (size_t k = 0; k < p->n_params; k++) {
        const char *name;
        sdm_fit_bounds(source, k, &p->low[k], &p->high[k], &name);
        p->distribution[k] = sdm_fit_distribution(source, k);
        double x;
        if (p->opts->start_params) {
            x = p->opts->start_params[k];
        } else if (source->model) {
            x = sdm_model_get_info(source->model)->params[k].def;
        } else {
            size_t n;
            x = sdm_instance_params(source->shape, &n)[k].def;
        }
        const double near = fmin(fmax(x, p->low[k]), p->high[k]);
        if (!isfinite(x) || (x != near && source->policy != SDM_RANGE_CLAMP)) {
            sdm_fail_range(name, x, p->low[k], p->high[k], "", err);
            return sdm_fail_in(err, SDM_E_RANGE, "start");
        }
        if (x != near) *clamped = true;
        p->state.params[k] = near;
    }
    return SDM_OK;
}

// sets up the problem at the start: state, memory, maps, and the extent of the shape
static sdm_status problem_start(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool share = p->target->kind == SDM_FIT_IMAGE && o->image_model == SDM_FIT_PARTIAL_VOLUME;
    sdm_status s = params_start(p, &out->start_clamped, err);
    if (!s) s = sdm_fit_maps_create(p->source, share, o, &p->maps, err);
    if (s) return s;
    p->maps.points = p->target->kind == SDM_FIT_POINTS;
    if (share && o->keep_blur && o->blur < p->maps.min_blur)
        return sdm_fail(err, SDM_E_ARG,
                        "a blur of %g mm is kept, but maps with voxels of %g mm carry one of %g mm "
                        "or more: take smaller voxels for the maps (spacing), or a wider blur",
                        o->blur, 2 * p->maps.min_blur, p->maps.min_blur);
    // the start state
    sdm_pose_matrix(&o->start_pose, p->state.rotation);
    memcpy(p->state.translation, o->start_pose.translation, sizeof p->state.translation);
    p->state.appearance = o->appearance;
    p->state.blur = fmax(o->blur, p->maps.min_blur);
    p->state.l_ref = o->l_ref;
    p->state.point_sd = o->point_sd;
    p->state.outliers = o->keep_appearance ? 0 : OUTLIERS_FIRST;
    p->prior = p->state;
    s = sdm_fit_blur_check(&p->maps.grid, share ? "blur" : "l_ref", share ? o->blur : o->l_ref,
                           sdm_fit_field_blur(p), err);
    if (s) return s;
    // memory, and maps at the start
    const size_t tissues = share ? o->appearance.n_inside + o->appearance.n_outside : 0;
    s = sdm_fit_information_create(fit_columns(p->n_params) + tissues, &p->information, err);
    if (!s) s = sdm_fit_information_create(fit_columns(p->n_params) + tissues, &p->trial, err);
    if (!s) s = sdm_fit_maps_make(&p->maps, p->state.params, true, err);
    if (!s) s = sdm_fit_maps_voxels(&p->maps, err);
    if (!s) s = sdm_fit_extent(&p->maps, &p->extent, err);
    memcpy(p->maps_params, p->state.params, sizeof p->maps_params);
    p->maps_blur = NAN;
    const double voxel = fit_longest_edge(&p->target->grid);
    if (!s && p->target->kind != SDM_FIT_POINTS && voxel > p->extent.reach)
        return sdm_fail(err, SDM_E_ARG,
                        "voxels of %.4g mm are larger than the shape, which reaches %.3g mm from "
                        "its middle: is the image in mm?",
                        voxel, p->extent.reach);
    p->state.outlier_density = 0.5 / fmax(p->extent.reach, o->point_sd);
    return s;
}

// takes the samples near the shape in its present position
static sdm_status samples_follow(fit_problem *p, bool *changed, sdm_error *err)
{
    fit_region region = {.radius = 1.5 * p->extent.reach + p->opts->margin,
                         .follow = &p->maps,
                         .state = &p->state,
                         .margin = p->opts->margin,
                         .max_samples = SAMPLES_MAX};
    sdm_fit_to_world(&p->state, p->extent.centre, region.centre);
    sdm_status s = SDM_OK;
    // the loop starts with the earlier stride, so that *changed compares samples of the same stride
    for (;; p->stride *= 2) {
        s = sdm_fit_samples_choose(p->target, p->opts, &region, p->stride, &p->samples, changed,
                                   err);
        if (s || p->target->kind == SDM_FIT_POINTS || p->samples.n <= SAMPLES_MAX) return s;
    }
}

// updates the prior weights from the residuals at the present state; *change: the largest relative
// change of a weight, 0 if it is negligible or no unknown has a prior
static sdm_status priors_reweight(fit_problem *p, double *change, sdm_error *err)
{
    double weight[FIT_UNKNOWNS_MAX] = {0};
    const sdm_status s = sdm_fit_weigh_priors(p, weight, &p->noise_factor, err);
    if (s) return s;
    *change = 0;
    for (size_t k = 0; k < p->information.n_unknowns; k++)
        *change = fmax(*change, fabs(weight[k] / p->prior_weight[k] - 1));
    if (*change > WEIGHT_EPS)
        memcpy(p->prior_weight, weight, sizeof weight);
    else
        *change = 0;
    if (!sdm_fit_has_prior(p)) *change = 0;
    return SDM_OK;
}

static sdm_status left_image(const fit_problem *p, sdm_error *err)
{
    const sdm_grid *g = &p->target->grid;
    const double *at = p->state.translation;
    double index[3], middle[3];
    for (int a = 0; a < 3; a++) index[a] = 0.5 * (double)(g->n[a] - 1);
    sdm_grid_world(g, index, middle);
    return sdm_fail(err, SDM_E_QUALITY,
                    "the shape has left the image: no voxel near it is left; the origin of its "
                    "frame is at %.4g, %.4g, %.4g mm, the middle of the image at %.4g, %.4g, %.4g "
                    "mm (LPS)",
                    at[0], at[1], at[2], middle[0], middle[1], middle[2]);
}

// repeats Newton's method until state, region and prior weights agree; end->converged is false if
// the iterations are used up before
static sdm_status maximise_settled(fit_problem *p, fit_newton_opts *newton, fit_newton_end *end,
                                   sdm_error *err)
{
    const size_t most = newton->max_iterations, before = p->n_iterations;
    // without priors a reweighting updates the noise factor only: twice with plain Newton steps,
    // not at all with the averaged gradient
    const int weighings = sdm_fit_has_prior(p) ? WEIGHINGS_MAX : newton->averaged ? 0 : 2;
    const double first = newton->averaged ? EPS_FIRST_AVERAGED : EPS_FIRST;
    const double eps = newton->eps;
    sdm_status s = SDM_OK;
    for (int round = 0; round < ROUNDS_MAX && !s; round++) {
        bool changed;
        double change = 0;
        s = sdm_fit_evaluate(p, err); // makes the maps by which samples_follow() selects voxels
        if (!s) s = samples_follow(p, &changed, err);
        if (!s && !p->samples.n) return left_image(p, err);
        if (!s && changed) s = sdm_fit_evaluate(p, err); // evaluate the new samples
        if (!s && changed) s = sdm_fit_tissue_field_update(p, err);
        if (!s) sdm_fit_open_motions_find(p);
        if (!s && round < weighings) s = priors_reweight(p, &change, err);
        // small and flat steps do not resolve small changes of region and weights
        const bool last =
            end->small || end->flat ? change < WEIGHT_ROUGH : !changed && !(change > 0);
        if (s || (round > 0 && (newton->eps <= eps || end->at_rest) && last)) return s;
        // set the number of iterations left, and a coarse eps until region and weights settle
        const size_t used = p->n_iterations - before;
        if (used >= most) {
            end->converged = false;
            return s;
        }
        newton->max_iterations = most - used;
        newton->eps = fmax(eps, first * (round ? fmin(change, 1) : 1));
        if (newton->averaged || round > 0) sdm_fit_appearance_mark_absent(p);
        s = sdm_fit_newton(p, newton, end, err);
        // from the second round on the tissues are estimated well enough for a tissue field
        p->use_tissue_field = true;
    }
    return s;
}

// whether the parameters lie within STEP_NEAR of their ranges of those of `state`
static bool stays_near(const fit_problem *p, const fit_state *state)
{
    bool near = true;
    for (size_t k = 0; k < p->n_params; k++)
        near = near &&
               fabs(p->state.params[k] - state->params[k]) <= STEP_NEAR * (p->high[k] - p->low[k]);
    return near;
}

/* Goes on with maps on a grid moved by half a voxel, too, where the place of the grid counts. If
 * steps with both grids do not converge, and lead nowhere else, the first grid alone decides. */
static sdm_status maximise_between(fit_problem *p, fit_newton_opts *newton, fit_newton_end *end,
                                   size_t max_iterations, double eps, sdm_error *err)
{
    const fit_state state = p->state;
    const fit_newton_end first = *end;
    const fit_recent recent = p->recent;
    bool added;
    if (!end->converged && !(end->step <= STEP_BETWEEN)) return SDM_OK;
    sdm_status s = sdm_fit_between_add(p, &added, err);
    if (s || !added) return s;
    newton->max_iterations = max_iterations;
    newton->eps = eps;
    s = maximise_settled(p, newton, end, err);
    if (s || end->converged || !first.converged || !stays_near(p, &state)) return s;
    sdm_fit_maps_between_end(&p->maps);
    p->maps_params[0] = p->maps_blur = NAN;
    p->state = state;
    p->recent = recent;
    *end = first;
    return sdm_fit_evaluate(p, err);
}

/* Maximises with maps of one kind. Plain Newton steps come first, then steps with the averaged
 * gradient: with exact maps because of the kinks of the likelihood; with a network's maps where
 * flat steps ended the iterations, because rounding errors of its derivatives then prevent
 * convergence along weakly determined directions. */
static sdm_status maximise_with_maps(fit_problem *p, fit_newton_opts *newton, fit_newton_end *end,
                                     sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool exact = p->maps.exact, average = !o->keep_params;
    const double polish = p->is_rival ? fmax(o->polish_eps, EPS_RIVAL) : o->polish_eps,
                 eps = exact ? polish : o->eps;
    const size_t max_iterations = newton->max_iterations;
    // plain Newton steps
    newton->averaged = p->use_tissue_field = false;
    p->samples.n_outside = 0;
    p->stride = 1;
    memset(p->absent, 0, sizeof p->absent);
    newton->eps = average ? o->eps : eps;
    newton->eps_sd = o->eps_sd;
    newton->max_flat = !average ? 0 : exact ? 1 : FLAT_MAX;
    sdm_status s = maximise_settled(p, newton, end, err);
    // where kinks keep plain steps from converging, averaged ones may
    const bool near = end->converged || end->step <= STEP_NEAR;
    if (s) return s;
    if (!average || !(exact || end->flat))
        return maximise_between(p, newton, end, max_iterations, eps, err);
    // averaged gradient
    const fit_state plain = p->state;
    const fit_newton_end first = *end;
    const fit_recent recent = p->recent;
    const double objective = sdm_fit_objective(p);
    newton->averaged = true;
    newton->max_iterations = max_iterations;
    newton->eps = eps;
    newton->max_flat = 0;
    sdm_fit_averaging_begin(p);
    if (near) s = maximise_settled(p, newton, end, err);
    // of points, whose likelihood has no error of maps, plain steps may have come higher
    if (!s && fit_maps_direct(&p->maps) && sdm_fit_objective(p) < objective - GAIN_EVEN) {
        p->state = plain, *end = first, p->recent = recent;
        p->maps_params[0] = NAN;
    } else if (!s) {
        s = maximise_between(p, newton, end, max_iterations, eps, err);
    }
    sdm_fit_averaging_end(p);
    return s ? s : sdm_fit_evaluate(p, err);
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Points, after the search: an sd that holds half of the points. It shrinks while the shape comes
 * nearer; with a small sd from the beginning, all points of a shape that is a little off would pass
 * for outliers. */
static sdm_status points_start(fit_problem *p, sdm_error *err)
{
    if (p->target->kind != SDM_FIT_POINTS || p->opts->keep_appearance) return SDM_OK;
    double *distance = NULL;
    sdm_status s = sdm_fit_evaluate(p, err);
    if (!s) s = SDM_ALLOC(&distance, p->samples.n, "points of the fit", err);
    if (s) return s;
    for (size_t i = 0; i < p->samples.n; i++) distance[i] = fabs(p->samples.field[i]);
    qsort(distance, p->samples.n, sizeof *distance, ascending);
    p->state.point_sd = fmax(p->state.point_sd, distance[p->samples.n / 2]);
    sdm_free(distance);
    return SDM_OK;
}

/* Points, after the fit: maximises again from the shape on whose surface they lie most evenly, and
 * keeps the better of both states. */
static sdm_status maximise_from_even(fit_problem *p, fit_newton_opts *newton, fit_newton_end *end,
                                     size_t max_iterations, sdm_error *err)
{
    const fit_state state = p->state;
    const fit_newton_end first = *end;
    const double objective = sdm_fit_objective(p);
    const fit_recent recent = p->recent;
    bool moved;
    sdm_status s = sdm_fit_even_points(p, &moved, err);
    newton->max_iterations = max_iterations;
    if (!s && moved) s = points_start(p, err);
    if (!s && moved) s = maximise_with_maps(p, newton, end, err);
    if (!s && moved && sdm_fit_objective(p) > objective + GAIN_EVEN) return SDM_OK;
    if (s && s != SDM_E_QUALITY) return s;
    p->state = state;
    *end = first;
    p->recent = recent;
    return sdm_fit_evaluate(p, err);
}

/* Maximises with maps of one kind; points twice, see maximise_from_even(). */
static sdm_status maximise_twice(fit_problem *p, fit_newton_opts *newton, fit_newton_end *end,
                                 sdm_error *err)
{
    const size_t max_iterations = newton->max_iterations;
    const sdm_status s = maximise_with_maps(p, newton, end, err);
    if (s || p->target->kind != SDM_FIT_POINTS || p->opts->keep_params) return s;
    return maximise_from_even(p, newton, end, max_iterations, err);
}

static sdm_status start_find(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const double from = sdm_clock();
    sdm_status s = sdm_fit_start_search(p, &out->turn, err);
    if (!s) s = points_start(p, err);
    out->seconds_search = sdm_clock() - from;
    return s;
}

/* Maximises in a phase, and reports how it ended. what: the name of the phase. */
static sdm_status maximise_in(fit_problem *p, sdm_fit_phase phase, size_t max_iterations,
                              const char *what, sdm_fit_result *out, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    fit_newton_opts newton = {.phase = phase,
                              .keep_params = o->keep_params,
                              .keep_pose = o->keep_pose,
                              .keep_blur = o->keep_blur,
                              .keep_appearance = o->keep_appearance,
                              .max_iterations = max_iterations};
    fit_newton_end end = {0};
    const sdm_status s = maximise_twice(p, &newton, &end, err);
    out->converged = !s && end.converged;
    if (out->converged && end.small)
        snprintf(out->reason, sizeof out->reason,
                 "%s: the last step moves no unknown by more than %g of its standard deviation",
                 what, newton.eps_sd);
    else if (out->converged && end.step > newton.eps)
        snprintf(out->reason, sizeof out->reason,
                 end.flat ? "%s: the last iterations hardly raise the likelihood"
                          : "%s: no step raises the likelihood any more",
                 what);
    else if (out->converged || end.step > newton.eps)
        snprintf(out->reason, sizeof out->reason, "%s%s: last step %.2g, %sbelow %g", what,
                 out->converged ? "" : " stopped", end.step, out->converged ? "" : "not ",
                 newton.eps);
    else
        snprintf(out->reason, sizeof out->reason,
                 "%s stopped: the last step, %.2g, was small, but the iterations were over before "
                 "the fit settled",
                 what, end.step);
    return s;
}

/* Goes on with exact maps after a fit with a network. */
static sdm_status polish(fit_problem *p, size_t max_iterations, sdm_fit_result *out, sdm_error *err)
{
    p->maps.exact = true;
    // the appearance restarts, because it may have modelled the network's errors as a tissue
    p->state.appearance = p->opts->appearance;
    p->maps_params[0] = NAN;
    return maximise_in(p, SDM_FIT_POLISH, max_iterations, "polish with exact maps", out, err);
}

// whether the shape of the network is known, so that exact maps can follow
static bool may_polish(const fit_problem *p) { return p->source->model && p->source->shape; }

/* Runs the main phase and the polish that the options ask for. Exact distances of points also end
 * what has not converged. */
static sdm_status maximise(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool points = p->target->kind == SDM_FIT_POINTS;
    const sdm_status s = maximise_in(p, SDM_FIT_MAIN, o->max_iterations,
                                     p->source->model ? "fit" : "fit with exact maps", out, err);
    if (s || !may_polish(p) || !o->max_polish_iterations || (!out->converged && !points)) return s;
    return polish(p, o->max_polish_iterations, out, err);
}

// standard deviation of the distances of the points on the surface, each by its probability to be
// none of the outliers; the scale of Student's t is smaller
static double scatter_of_points(const fit_problem *p)
{
    double sum = 0, n = 0;
    for (size_t i = 0; i < p->samples.n; i++) {
        const double x = p->samples.field[i], w = sdm_fit_point_belongs(&p->observation, x);
        sum += w * x * x;
        n += w;
    }
    return n > 0 ? sqrt(sum / n) : 0;
}

// writes the estimate and the counts to *out, which holds covariance and evidence already
static void report(fit_problem *p, sdm_fit_result *out)
{
    const fit_state *s = &p->state;
    for (size_t k = 0; k < p->n_params; k++) {
        out->params[k] = s->params[k];
        out->at_bound[k] =
            !fit_param_is_kept(p, k) && (s->params[k] <= p->low[k] || s->params[k] >= p->high[k]);
        out->prior_sd[k] = sdm_fit_prior_sd(p, k);
        out->by_prior[k] = out->sd[k] > FIT_BY_PRIOR * out->prior_sd[k];
    }
    sdm_rotation_vector(s->rotation, out->pose.rotation);
    memcpy(out->pose.translation, s->translation, sizeof out->pose.translation);
    out->n_exact_outside = p->maps.n_outside;
    out->polished = p->source->model && p->maps.exact;
    out->n_iterations = p->n_iterations;
    out->objective = p->objective;
    p->objective = NULL;
    out->log_likelihood = p->information.log_likelihood;
    out->n_used = p->samples.n;
    out->n_nan = p->samples.n_nan;
    out->blur = p->maps.share ? s->blur : 0;
    out->appearance = s->appearance;
    out->point_sd = p->target->kind == SDM_FIT_POINTS ? scatter_of_points(p) : 0;
    out->outliers = p->target->kind == SDM_FIT_POINTS ? s->outliers : 0;
    sdm_fit_open_motions_describe(p, out->open_motions, sizeof out->open_motions);
}

// writes what the fit has cost, the checks included
static void report_work(const fit_problem *p, double from, sdm_fit_result *out)
{
    out->n_network = p->maps.n_network;
    out->n_exact = p->maps.n_exact;
    out->seconds_network = p->maps.seconds_network;
    out->seconds_exact = p->maps.seconds_exact;
    out->seconds = sdm_clock() - from;
}

// are single parameters kept?
static bool keeps_some(const fit_problem *p)
{
    if (p->opts->keep_params) return false;
    for (size_t k = 0; k < p->n_params; k++)
        if (fit_param_is_kept(p, k)) return true;
    return false;
}

// the verdict; leaves *p at a rival, with a kept pose at the state of a free one
static sdm_status judge(fit_problem *p, sdm_fit_result *r, sdm_error *err)
{
    double factor;
    sdm_status s = sdm_fit_maps_voxels(&p->maps, err);
    if (!s) s = sdm_fit_judge(p, r, &factor, err);
    if (s && s != SDM_E_QUALITY) return s;
    sdm_fit_name_restless(p, r, s ? err : NULL);
    const sdm_status params = keeps_some(p) ? sdm_fit_judge_kept_params(p, r, err) : SDM_OK;
    if (params && params != SDM_E_QUALITY) return params;
    if (params) s = params;
    if (!s && !p->is_rival) s = sdm_fit_judge_next_pose(p, factor, r, err);
    const sdm_status kept = p->opts->keep_pose ? sdm_fit_judge_kept_pose(p, r, err) : SDM_OK;
    return kept ? kept : s;
}

// computes the covariance, the share of the shape in the image, and what the image says without it
static sdm_status assess(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    sdm_status s = sdm_fit_pose_params_find(p, err);
    if (!s) s = sdm_fit_posterior(p, out, err);
    if (!s && !p->is_rival) s = sdm_fit_flat_params_spread(p, out, err);
    if (s && s != SDM_E_QUALITY) return s;
    if (!s) sdm_fit_network_error_find(p, out);
    out->inside_share = sdm_fit_inside_share(p);
    if (fit_is_image(p)) {
        const sdm_status found =
            sdm_fit_shapeless_log_likelihood(p, &out->log_likelihood_without, err);
        if (found) return found;
    }
    return s;
}

/* After the fit: what lies beyond the open end is no evidence about the fit either. */
static sdm_status beyond_leave(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    out->n_beyond = sdm_fit_samples_drop_beyond(&p->samples);
    if (!p->samples.n) return left_image(p, err);
    return out->n_beyond ? sdm_fit_evaluate(p, err) : SDM_OK;
}

/* From the state of *p to a verdict. *fitted: the state that the result reports. */
static sdm_status attempt(fit_problem *p, sdm_fit_result *out, fit_state *fitted, sdm_error *err)
{
    if (p->n_begun < FIT_BEGUN) p->begun[p->n_begun++] = p->state;
    // 5. maximise the posterior; 6. covariance
    sdm_status s = maximise(p, out, err);
    const double from = sdm_clock();
    if (!s) sdm_fit_tell_progress(p, SDM_FIT_JUDGE, 0);
    if (!s) s = beyond_leave(p, out, err);
    if (!s) s = assess(p, out, err);
    if (!s) sdm_fit_accept_small_steps(p, out);
    // points that do not come to rest with a network go on with exact distances
    if (!s && !out->converged && may_polish(p) && !p->maps.exact && !p->is_rival &&
        p->target->kind == SDM_FIT_POINTS) {
        s = polish(p, p->opts->max_iterations, out, err);
        out->network_error_sd = NAN;
        if (!s) s = assess(p, out, err);
        if (!s) sdm_fit_accept_small_steps(p, out);
    }
    // 7. report the result, also of a fit that failed with SDM_E_QUALITY; 8. judge it
    if (!s || s == SDM_E_QUALITY) report(p, out);
    *fitted = p->state;
    if (!s) s = judge(p, out, err);
    out->seconds_verdict += sdm_clock() - from;
    if (s) out->verdict.grade = SDM_FIT_FAILED;
    return s;
}

// makes *p and *out ready for another attempt
static sdm_status attempt_renew(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    p->objective = out->objective;
    out->objective = NULL;
    const sdm_fit_result old = *out;
    sdm_fit_dispose(out);
    const sdm_status s = result_create(p->n_params, out, err);
    out->turn = old.turn;
    out->seconds_search = old.seconds_search;
    out->seconds_verdict = old.seconds_verdict;
    out->start_clamped = old.start_clamped;
    out->n_cavity = old.n_cavity;
    out->widest_space = old.widest_space;
    out->n_restarts = old.n_restarts + 1;
    for (size_t k = 0; k < FIT_UNKNOWNS_MAX; k++) p->prior_weight[k] = 1;
    p->noise_factor = 1;
    p->recent = (fit_recent){0};
    return s;
}

/* A fit that was refused may have stopped in a wrong pose or at a wrong value of a parameter: goes
 * on from a better one, if there is one. `exact`: the kind of maps with which the fit began. */
static sdm_status attempt_again(fit_problem *p, bool exact, sdm_fit_result *out, fit_state *fitted,
                                bool *again, sdm_error *err)
{
    const double from = sdm_clock();
    p->state = p->has_better ? p->better : *fitted;
    p->maps.exact = exact;
    p->maps_params[0] = NAN;
    *again = p->has_better;
    sdm_status s = p->has_better ? SDM_OK : sdm_fit_other_values(p, NULL, again, err);
    p->has_better = false;
    const double seconds = sdm_clock() - from;
    out->seconds_search += seconds;
    if (s || !*again) return s;
    s = attempt_renew(p, out, err);
    if (!s) s = points_start(p, err);
    return s ? s : attempt(p, out, fitted, err);
}

// *out = a copy of the values of `from`, which keeps its memory; the objective of *p is copied
static sdm_status result_branch(fit_problem *p, const sdm_fit_result *from, sdm_fit_result *out,
                                sdm_error *err)
{
    double *objective = NULL;
    const sdm_status s = SDM_ALLOC(&objective, p->objective_capacity, "result of the fit", err);
    if (s) return s;
    memcpy(objective, from->objective, p->n_iterations * sizeof *objective);
    *out = *from;
    out->params = out->covariance = out->sd = out->correlation = out->prior_sd = NULL;
    out->at_bound = out->by_prior = NULL;
    out->objective = objective;
    return SDM_OK;
}

/* A fit to points that passes, or leaves doubt, although the shape explains them better in another
 * pose: fits from this pose, too, and keeps the better one of both, whatever its verdict is. */
static sdm_status attempt_better(fit_problem *p, bool exact, sdm_fit_result *out, fit_state *fitted,
                                 bool *again, sdm_error *err)
{
    sdm_fit_result first = *out, second;
    const double gain_least = SDM_FIT_PREFERRED * p->noise_factor;
    sdm_status s = result_branch(p, &first, &second, err);
    if (s) return s;
    s = attempt_again(p, exact, &second, fitted, again, err);
    const bool failed = s && s != SDM_E_QUALITY;
    *again = !failed && second.n_used >= first.n_used &&
             second.log_likelihood > first.log_likelihood + gain_least;
    if (failed || *again) {
        sdm_fit_dispose(&first);
        *out = second;
        return s;
    }
    first.seconds_search = second.seconds_search;
    first.seconds_verdict = second.seconds_verdict;
    sdm_fit_dispose(&second);
    *out = first;
    if (!*again) sdm_fit_next_pose_tried(&out->verdict);
    return SDM_OK;
}

/* The name of the first check that failed; NULL: none did. */
static const char *failed_check(const sdm_fit_verdict *v)
{
    for (size_t i = 0; i < v->n_findings; i++)
        if (v->findings[i].grade == SDM_FIT_FAILED) return sdm_fit_check_name(v->findings[i].kind);
    return NULL;
}

/* Fits and judges, and begins again from another pose or value of a parameter as long as the fit is
 * refused, or points leave doubt, and this explains the data better. */
static sdm_status attempts(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool exact = p->maps.exact;
    bool again = !p->is_rival && !o->keep_params && !o->keep_pose;
    fit_state fitted;
    sdm_status s = attempt(p, out, &fitted, err);
    for (size_t i = 0; i < o->max_restarts && again; i++) {
        sdm_error trouble = {0};
        sdm_status tried;
        p->refused_by = failed_check(&out->verdict);
        if (s == SDM_E_QUALITY)
            tried = attempt_again(p, exact, out, &fitted, &again, &trouble);
        else if (!s && p->has_better)
            tried = attempt_better(p, exact, out, &fitted, &again, &trouble);
        else
            break;
        // without a better start the verdict stands
        if (!again && tried != SDM_E_NOMEM && tried != SDM_E_CANCELLED) break;
        s = tried;
        if (err) *err = trouble;
    }
    return s;
}

static sdm_status run(const sdm_fit_source *source, const sdm_fit_target *target,
                      const sdm_fit_opts *opts, bool is_rival, sdm_fit_result *out, sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "fit: a place for the result is needed");
    *out = (sdm_fit_result){0};
    const double from = sdm_clock();
    fit_problem p = {
        .source = source, .target = target, .opts = opts, .is_rival = is_rival, .noise_factor = 1};
    for (size_t k = 0; k < FIT_UNKNOWNS_MAX; k++) p.prior_weight[k] = 1;

    // 1. check the arguments
    sdm_status s = sdm_fit_check_source(source, &p.n_params, err);
    if (!s) s = sdm_fit_check(target, opts, err);
    if (!s) s = sdm_fit_check_open_end(source, target, opts, err);

    // 2. present a label map as an image; remove the cavities of an image
    sdm_fit_target as_image;
    sdm_fit_opts with_labels;
    float *values = NULL;
    if (!s && target->kind == SDM_FIT_LABEL && opts->image_model == SDM_FIT_PARTIAL_VOLUME) {
        as_image = *target, with_labels = *opts;
        s = sdm_fit_labels_as_image(source, &as_image, &with_labels, &values, err);
        p.target = &as_image, p.opts = &with_labels, p.given_labels = true;
    }
    if (!s && target->kind == SDM_FIT_IMAGE && opts->cavity > 0) {
        s = sdm_fit_mask_cavities(target, opts, &values, &out->n_cavity, &out->widest_space, err);
        as_image = *target, as_image.values = values;
        p.target = &as_image;
    }

    // 3. set up the problem at the start; 4. search for a better start
    if (!s) s = result_create(p.n_params, out, err);
    if (!s) s = problem_start(&p, out, err);
    if (!s) s = start_find(&p, out, err);
    if (s && out->n_params && s == SDM_E_QUALITY) report(&p, out);
    if (s) out->verdict.grade = SDM_FIT_FAILED;

    // 5. to 8. fit and judge
    if (!s) s = attempts(&p, out, err);
    if (s && err && !*out->reason) snprintf(out->reason, sizeof out->reason, "%.255s", err->text);
    report_work(&p, from, out);
    problem_dispose(&p);
    sdm_free(values);
    if (s && s != SDM_E_QUALITY) sdm_fit_dispose(out);
    return s;
}

sdm_status sdm_fit(const sdm_fit_source *source, const sdm_fit_target *target,
                   const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err)
{
    return run(source, target, opts, false, out, err);
}

sdm_status sdm_fit_rival(const sdm_fit_source *source, const sdm_fit_target *target,
                         const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err)
{
    return run(source, target, opts, true, out, err);
}
