/* The fit from beginning to end. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit/data/blur.h"
#include "fit/data/cavity.h"
#include "fit/solver/averaged_gradient.h"
#include "fit/solver/tissue_field.h"
#include "fit/solver/tissues.h"
#include "fit/start/start_search.h"
#include "fit/trust/evidence.h"
#include "fit/trust/posterior.h"
#include "fit/trust/scores.h"
#include "fit_check.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/rotation.h"
#include "sdm/memory.h"

// the region follows the shape, and the priors are weighed, so many times at most
#define ROUNDS_MOST 8
// voxels at most, before only every second one along each axis is taken
#define SITES_MOST 2000000
// as long as the region and the weights of the priors are not the last, small steps are not worth
// while
#define EPS_FIRST 1e-2
#define EPS_FIRST_AVERAGED 1e-4
// relative change of the weights that is left
#define WEIGHT_EPS 1e-3
#define WEIGHT_ROUGH 0.05
// so many steps in a row that promise no gain are an end; exact maps have creases, and need not try
// again
#define FLAT_MOST 6
// of the deviation before the fit: what is left where the target says next to nothing
#define BY_PRIOR 0.9
// a prior against all evidence would feed itself: the worse the fit, the more alike are
// neighbouring residuals
#define WEIGHINGS_MOST 4

sdm_fit_opts sdm_fit_defaults(void)
{
    return (sdm_fit_opts){
        .image_model = SDM_FIT_PARTIAL_VOLUME,
        .l_ref = 0.2,
        .blur = 0.2,
        .appearance = {.n_inside = 1,
                       .n_outside = 2,
                       .inside = {{.weight = 1, .mean = 40, .sd = 170}},
                       .outside = {{.weight = 0.9, .mean = 1300, .sd = 270},
                                   {.weight = 0.1, .mean = -880, .sd = 150}}},
        .tissue_mm = 1,
        .point_sd = 0.1,
        .point_dof = 4,
        .n_turns = 1,
        .prior_sd = 1,
        .margin = 1.5,
        .least_inside = 0.5,
        .max_iterations = 60,
        .max_polish_iterations = 0,
        .eps = 1e-4,
        .polish_eps = 3e-6,
    };
}

void sdm_fit_dispose(sdm_fit_result *r)
{
    sdm_free(r->params);
    sdm_free(r->covariance);
    sdm_free(r->sd);
    sdm_free(r->correlation);
    sdm_free(r->at_bound);
    sdm_free(r->by_prior);
    sdm_free(r->objective);
    *r = (sdm_fit_result){0};
}

static sdm_status make_result(size_t n, sdm_fit_result *out, sdm_error *err)
{
    const size_t size = n + 6;
    out->n_params = n;
    out->log_likelihood_without = out->evidence = NAN;
    out->inside_share = out->noise_factor = out->model_error_mm = NAN;
    sdm_status s = SDM_ALLOC(&out->params, n, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->covariance, size * size, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->sd, size, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->correlation, size * size, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->at_bound, n, "result of the fit", err);
    if (!s) s = SDM_ALLOC(&out->by_prior, n, "result of the fit", err);
    for (size_t i = 0; i < size * size && !s; i++) out->covariance[i] = out->correlation[i] = NAN;
    for (size_t i = 0; i < size && !s; i++) out->sd[i] = NAN;
    return s;
}

static void dispose_problem(fit_problem *p)
{
    sdm_fit_maps_dispose(&p->maps);
    sdm_fit_sites_dispose(&p->sites);
    sdm_fit_sums_dispose(&p->sums);
    sdm_fit_sums_dispose(&p->trial);
    sdm_free(p->objective);
}

static sdm_status start_params(fit_problem *p, bool *clamped, sdm_error *err)
{
    const sdm_fit_source *source = p->source;
    for (size_t k = 0; k < p->n_params; k++) {
        const char *name;
        sdm_fit_bounds(source, k, &p->low[k], &p->high[k], &name);
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
        if (!isfinite(x) || (x != near && source->policy != SDM_RANGE_CLAMP))
            return sdm_fail(err, SDM_E_RANGE, "start of %s = %.9g, need %.9g to %.9g", name, x,
                            p->low[k], p->high[k]);
        if (x != near) *clamped = true;
        p->state.params[k] = near;
    }
    return SDM_OK;
}

static sdm_status begin(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool share = p->target->kind == SDM_FIT_IMAGE && o->image_model == SDM_FIT_PARTIAL_VOLUME;
    sdm_status s = start_params(p, &out->start_clamped, err);
    if (!s) s = sdm_fit_maps_create(p->source, share, o, &p->maps, err);
    if (s) return s;
    if (share && o->keep_blur && o->blur < p->maps.least_blur)
        return sdm_fail(err, SDM_E_ARG,
                        "a blur of %g mm is kept, but maps with voxels of %g mm carry one of %g mm "
                        "or more: take smaller "
                        "voxels for the maps (spacing), or a wider blur",
                        o->blur, 2 * p->maps.least_blur, p->maps.least_blur);
    sdm_pose_matrix(&o->start_pose, p->state.rotation);
    memcpy(p->state.translation, o->start_pose.translation, sizeof p->state.translation);
    p->state.look = o->appearance;
    p->state.blur = fmax(o->blur, p->maps.least_blur);
    p->state.l_ref = o->l_ref;
    p->state.point_sd = o->point_sd;
    p->prior = p->state;
    s = sdm_fit_blur_check(&p->maps.grid, share ? "blur" : "l_ref", share ? o->blur : o->l_ref,
                           sdm_fit_field_blur(p), err);
    if (s) return s;
    const size_t tissues = share ? o->appearance.n_inside + o->appearance.n_outside : 0;
    s = sdm_fit_sums_create(fit_columns(p->n_params) + tissues, &p->sums, err);
    if (!s) s = sdm_fit_sums_create(fit_columns(p->n_params) + tissues, &p->trial, err);
    if (!s) s = sdm_fit_maps_at(&p->maps, p->state.params, true, err);
    if (!s) s = sdm_fit_extent(&p->maps, &p->extent, err);
    memcpy(p->maps_at, p->state.params, sizeof p->maps_at);
    p->packed_blur = NAN;
    return s;
}

// the voxels about the shape where it is now
static sdm_status follow(fit_problem *p, bool *changed, sdm_error *err)
{
    fit_region region = {.radius = 1.5 * p->extent.reach + p->opts->margin,
                         .follow = &p->maps,
                         .state = &p->state,
                         .margin = p->opts->margin,
                         .most = SITES_MOST};
    sdm_fit_to_world(&p->state, p->extent.centre, region.centre);
    sdm_status s = SDM_OK;
    for (;; p->stride *= 2) { // from that of before on: whether voxels are others is asked of those
        s = sdm_fit_sites_choose(p->target, p->opts, &region, p->stride, &p->sites, changed, err);
        if (s || p->target->kind == SDM_FIT_POINTS || p->sites.n <= SITES_MOST) return s;
    }
}

// the weights of the priors from the residuals where the fit stands; *change: the largest,
// relative, 0 where they are left
static sdm_status weigh_priors(fit_problem *p, double *change, sdm_error *err)
{
    double weight[FIT_PARAMS_MAX + 6] = {0};
    const sdm_status s = sdm_fit_weigh_priors(p, weight, &p->noise_factor, err);
    if (s) return s;
    *change = 0;
    for (size_t k = 0; k < p->n_params + 6; k++)
        *change = fmax(*change, fabs(weight[k] / p->prior_weight[k] - 1));
    if (*change > WEIGHT_EPS)
        memcpy(p->prior_weight, weight, sizeof weight);
    else
        *change = 0;
    if (!sdm_fit_has_prior(p)) *change = 0;
    return SDM_OK;
}

// iterates until neither the state nor the region nor the weights of the priors change
static sdm_status settle(fit_problem *p, fit_run *run, fit_ended *ended, sdm_error *err)
{
    const size_t most = run->max_iterations, before = p->n_iterations;
    // without priors only the noise factor is of use, and by averaged derivatives that of before
    const int weighings = sdm_fit_has_prior(p) ? WEIGHINGS_MOST : run->averaged ? 0 : 2;
    const double first = run->averaged ? EPS_FIRST_AVERAGED : EPS_FIRST;
    const double eps = run->eps;
    sdm_status s = SDM_OK;
    for (int round = 0; round < ROUNDS_MOST && !s; round++) {
        bool changed;
        double change = 0;
        s = sdm_fit_look(p, err); // maps of the state
        if (!s) s = follow(p, &changed, err);
        if (!s && !p->sites.n)
            return sdm_fail(err, SDM_E_QUALITY,
                            "the shape has left the image: no voxel near it is left");
        if (!s && changed) s = sdm_fit_look(p, err); // samples of the region
        if (!s && changed) s = sdm_fit_places_update(p, err);
        if (!s && round < weighings) s = weigh_priors(p, &change, err);
        // steps that are rough do not tell small changes of the region and the weights
        const bool last = ended->rough ? change < WEIGHT_ROUGH : !changed && !(change > 0);
        if (s || (round > 0 && run->eps <= eps && last)) return s;
        const size_t used = p->n_iterations - before;
        if (used >= most) {
            ended->converged = false;
            return s;
        }
        run->max_iterations = most - used;
        run->eps = fmax(eps, first * (round ? fmin(change, 1) : 1));
        if (run->averaged) sdm_fit_ways(p, run->way);
        if (run->averaged || round > 0) sdm_fit_look_settle(p);
        s = sdm_fit_iterate(p, run, ended, err);
        p->places = true; // tissues that are there by now
    }
    return s;
}

/* To the maximum with maps of one kind. Its last part goes by averaged derivatives: exact maps have
   creases, and where the data say little of a parameter the rounding of a network's derivatives
   makes steps that do not end. */
static sdm_status approach(fit_problem *p, fit_run *run, fit_ended *ended, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool exact = p->maps.exact, average = !o->keep_params;
    const double eps = exact ? o->polish_eps : o->eps;
    const size_t max_iterations = run->max_iterations;
    run->averaged = p->places = false;
    p->sites.n_outside = 0;
    p->stride = 1;
    memset(p->absent, 0, sizeof p->absent);
    run->eps = average ? o->eps : eps;
    run->flat_most = !average ? 0 : exact ? 1 : FLAT_MOST;
    sdm_status s = settle(p, run, ended, err);
    if (s || !ended->converged || !average || !(exact || ended->rough)) return s;
    run->averaged = true;
    run->max_iterations = max_iterations;
    run->eps = eps;
    run->flat_most = 0;
    return settle(p, run, ended, err);
}

static sdm_status climb(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const double from = sdm_clock();
    sdm_status s = sdm_fit_search(p, &out->turn, err);
    out->seconds_search = sdm_clock() - from;
    if (s) return s;
    fit_run run = {.phase = SDM_FIT_MAIN,
                   .keep_params = o->keep_params,
                   .keep_pose = o->keep_pose,
                   .keep_blur = o->keep_blur,
                   .keep_look = o->keep_appearance,
                   .max_iterations = o->max_iterations};
    fit_ended ended = {0};
    s = approach(p, &run, &ended, err);
    const char *what = p->source->model ? "fit" : "fit with exact maps";
    if (!s && ended.converged && p->source->model && p->source->shape && o->max_polish_iterations) {
        p->maps.exact = true;
        p->state.look = o->appearance; // the network's errors may have become a tissue
        p->maps_at[0] = NAN;
        run.phase = SDM_FIT_POLISH;
        run.max_iterations = o->max_polish_iterations;
        what = "polish with exact maps";
        s = approach(p, &run, &ended, err);
    }
    out->converged = !s && ended.converged;
    snprintf(out->reason, sizeof out->reason, "%s%s: last step %.2g, %sbelow %g", what,
             out->converged ? "" : " stopped", ended.step, out->converged ? "" : "not ", run.eps);
    return s;
}

static void report(fit_problem *p, sdm_fit_result *out)
{
    const fit_state *s = &p->state;
    for (size_t k = 0; k < p->n_params; k++) {
        out->params[k] = s->params[k];
        out->at_bound[k] = s->params[k] <= p->low[k] || s->params[k] >= p->high[k];
        out->by_prior[k] = out->sd[k] > BY_PRIOR * sdm_fit_prior_sd(p, k);
    }
    sdm_rotation_vector(s->rotation, out->pose.rotation);
    memcpy(out->pose.translation, s->translation, sizeof out->pose.translation);
    out->n_exact_outside = p->maps.n_outside;
    out->n_iterations = p->n_iterations;
    out->objective = p->objective;
    p->objective = NULL;
    out->log_likelihood = p->sums.log_likelihood;
    out->n_used = p->sites.n;
    out->n_nan = p->sites.n_nan;
    out->blur = p->maps.share ? s->blur : 0;
    out->appearance = s->look;
    out->point_sd = p->target->kind == SDM_FIT_POINTS ? s->point_sd : 0;
    out->n_network = p->maps.n_network;
    out->n_exact = p->maps.n_exact;
    out->seconds_network = p->maps.seconds_network;
    out->seconds_exact = p->maps.seconds_exact;
}

// mean of the mixture
static double mean_of(const sdm_fit_law *law, size_t n)
{
    size_t most = 0;
    for (size_t i = 1; i < n; i++)
        if (law[i].weight > law[most].weight) most = i;
    return law[most].mean;
}

// reasons not to believe a fit, the plainest first
static sdm_status judge(const fit_problem *p, const sdm_fit_result *r, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const sdm_fit_appearance *a = &r->appearance, *b = &o->appearance;
    if (p->target->kind == SDM_FIT_IMAGE && !p->given_labels) {
        const double in = mean_of(a->inside, a->n_inside), out = mean_of(a->outside, a->n_outside);
        const bool darker = mean_of(b->inside, b->n_inside) < mean_of(b->outside, b->n_outside);
        if (!(r->evidence > 0))
            return sdm_fail(err, SDM_E_QUALITY,
                            "the image shows no such shape near the start: explaining it without "
                            "one is better by %.3g "
                            "(log-likelihood of independent voxels); check the start pose, and "
                            "whether the inside is "
                            "%s than the outside in this image",
                            -r->evidence, darker ? "darker" : "brighter");
        if ((in < out) != darker)
            return sdm_fail(err, SDM_E_QUALITY,
                            "the contrast is the opposite of the start's: inside %.4g, outside "
                            "%.4g, but the start says "
                            "that the inside is %s; give laws of this kind of image",
                            in, out, darker ? "darker" : "brighter");
    }
    const double widest = sdm_fit_inradius(&p->maps);
    if (r->n_cavity && !(widest < o->cavity))
        return sdm_fail(err, SDM_E_QUALITY,
                        "the fitted shape holds a ball of %.3g mm, but spaces that hold one of "
                        "%.3g mm were left out "
                        "(cavity): give a radius above that of the shape",
                        widest, o->cavity);
    if (!(r->inside_share >= o->least_inside))
        return sdm_fail(err, SDM_E_QUALITY,
                        "only %.0f %% of the shape lies in the image, need %.0f %% (least_inside)",
                        100 * r->inside_share, 100 * o->least_inside);
    if (!r->converged)
        return sdm_fail(
            err, SDM_E_QUALITY,
            "not converged after %zu iterations (%s); allow more of them, or give a nearer start",
            r->n_iterations, r->reason);
    return SDM_OK;
}

static sdm_status finish(fit_problem *p, sdm_fit_result *out, sdm_error *err)
{
    sdm_status s = sdm_fit_posterior(p, out, err);
    if (s && s != SDM_E_QUALITY) return s;
    out->inside_share = sdm_fit_inside_share(p);
    if (p->target->kind == SDM_FIT_IMAGE && !p->given_labels) {
        const sdm_status found = sdm_fit_without_shape(p, &out->log_likelihood_without, err);
        if (found) return found;
        const double factor = fmax(out->noise_factor, 1), n = (double)p->sites.n / factor;
        const double unknowns =
            (p->opts->keep_params ? 0 : (double)p->n_params) + (p->opts->keep_pose ? 0 : 6);
        out->evidence = (p->sums.log_likelihood - out->log_likelihood_without) / factor -
                        0.5 * unknowns * log(n);
    }
    return s;
}

// a label map as an image of what is 1 inside and 0 outside: shares, seen through a point spread
// that is narrow
static void take_labels(sdm_fit_target *target, sdm_fit_opts *opts)
{
    target->kind = SDM_FIT_IMAGE;
    opts->appearance = (sdm_fit_appearance){.n_inside = 1,
                                            .n_outside = 1,
                                            .inside = {{.weight = 1, .mean = 1, .sd = 0.25}},
                                            .outside = {{.weight = 1, .mean = 0, .sd = 0.25}}};
    opts->keep_appearance = true;
}

sdm_status sdm_fit(const sdm_fit_source *source, const sdm_fit_target *target,
                   const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "fit: a place for the result is needed");
    *out = (sdm_fit_result){0};
    const double from = sdm_clock();
    fit_problem p = {.source = source, .target = target, .opts = opts, .noise_factor = 1};
    for (size_t k = 0; k < FIT_PARAMS_MAX + 6; k++) p.prior_weight[k] = 1;
    sdm_fit_target as_image;
    sdm_fit_opts with_labels;
    sdm_status s = sdm_fit_check_source(source, &p.n_params, err);
    if (!s) s = sdm_fit_check(target, opts, err);
    if (!s && target->kind == SDM_FIT_LABEL && opts->image_model == SDM_FIT_PARTIAL_VOLUME) {
        as_image = *target, with_labels = *opts;
        take_labels(&as_image, &with_labels);
        p.target = &as_image, p.opts = &with_labels, p.given_labels = true;
    }
    float *values = NULL;
    if (!s && target->kind == SDM_FIT_IMAGE && opts->cavity > 0) {
        s = sdm_fit_leave_out_cavities(target, opts, &values, &out->n_cavity, err);
        as_image = *target, as_image.values = values;
        p.target = &as_image;
    }
    if (!s) s = make_result(p.n_params, out, err);
    if (!s) s = begin(&p, out, err);
    if (!s) s = climb(&p, out, err);
    if (!s) s = finish(&p, out, err);
    if (out->n_params && (!s || s == SDM_E_QUALITY)) report(&p, out);
    if (!s) s = judge(&p, out, err);
    if (s && err && !*out->reason) snprintf(out->reason, sizeof out->reason, "%.255s", err->text);
    dispose_problem(&p);
    sdm_free(values);
    out->seconds = sdm_clock() - from;
    if (s && s != SDM_E_QUALITY) sdm_fit_dispose(out);
    return s;
}
