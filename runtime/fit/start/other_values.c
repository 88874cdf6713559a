/* Starts with another value of one parameter: ranked by the likelihood of some samples with a wide
 * point spread, then continued as the starts of the search are. */
#include "other_values.h"

#include <math.h>

#include "fit/solver/objective.h"
#include "principal_axes.h"
#include "sdm/internal/mat3.h"
#include "sdm/memory.h"
#include "start_list.h"
#include "start_search.h"

// values of a parameter that are tried: the middles of this many equal parts of its range, without
// those nearer to the value of the fit than a part
#define N_PARTS 6
// shifts along each axis of the shape, to either side; the largest is this share of its reach
#define N_SHIFTS 12
#define LARGEST_SHIFT 0.6
// starts that continue, each with another value of another parameter
#define N_KEPT 4
// samples on which starts are ranked, and on which the best continue
#define SAMPLES_RANKED 2000
#define SAMPLES_OF_KEPT 30000
// gain of the log-posterior density, as of independent samples, from which on a fit begins again
#define GAIN_LEAST 3.0
// a shape that has this Dice coefficient with that of the fit is the same one, found more exactly
#define ALIKE 0.95

// *best = the best pose of the shape with the latest map: that of `state`, or, if it is
// free, shifted along one of the axes (rows, world)
static void shift_find(const fit_problem *p, const fit_state *state, const double axes[9],
                       double step, fit_start *best)
{
    *best = (fit_start){.state = *state,
                        .log_likelihood = sdm_fit_likelihood_at(p, state, SAMPLES_RANKED)};
    for (int a = 0; a < 3 && !p->opts->keep_pose; a++)
        for (int i = -N_SHIFTS; i <= N_SHIFTS; i++) {
            fit_start one = {.state = *state};
            for (int k = 0; k < 3; k++) one.state.translation[k] += i * step * axes[3 * a + k];
            one.log_likelihood =
                i ? sdm_fit_likelihood_at(p, &one.state, SAMPLES_RANKED) : -INFINITY;
            if (one.log_likelihood > best->log_likelihood) *best = one;
        }
}

// axes[9]: rows, the principal axes of the shape at the state of *p, in the world
static sdm_status axes_find(fit_problem *p, double axes[9], sdm_error *err)
{
    fit_extent e;
    double own[9];
    sdm_status s = sdm_fit_maps_voxels(&p->maps, err);
    if (!s) s = sdm_fit_extent(&p->maps, &e, err);
    if (s) return s;
    sdm_fit_principal_axes(&p->maps, e.centre, own);
    for (int a = 0; a < 3; a++) m3_apply(p->state.rotation, own + 3 * a, axes + 3 * a);
    return SDM_OK;
}

// list[N_KEPT] = the best starts with another value of one parameter of `of`, at most one for each;
// *n: how many
static sdm_status values_rank(fit_problem *p, const bool *of, const double axes[9], double step,
                              fit_start *list, size_t *n, sdm_error *err)
{
    const fit_state from = p->state;
    *n = 0;
    for (size_t k = 0; k < p->n_params; k++) {
        if (fit_param_is_kept(p, k) || (of && !of[k])) continue;
        fit_start of_param = {.log_likelihood = -INFINITY};
        for (int i = 0; i < N_PARTS; i++) {
            const double part = (p->high[k] - p->low[k]) / N_PARTS,
                         value = p->low[k] + (i + 0.5) * part;
            if (fabs(value - from.params[k]) < part) continue;
            fit_state state = from;
            state.params[k] = value;
            double log_likelihood;
            const sdm_status s = sdm_fit_log_likelihood(p, state.params, &log_likelihood, err);
            if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return s;
            if (s) continue; // there is no shape with this value
            fit_start best;
            shift_find(p, &state, axes, step, &best);
            if (best.log_likelihood > of_param.log_likelihood) of_param = best;
        }
        if (of_param.log_likelihood > -INFINITY) sdm_fit_start_insert(list, n, N_KEPT, &of_param);
    }
    return SDM_OK;
}

// whether sample i lies inside the shape, as the latest evaluation sees it
static bool is_inside(const fit_problem *p, size_t i)
{
    return p->maps.share ? p->samples.field[i] > 0.5 : p->samples.field[i] < 0;
}

// whether the shape holds about the same samples as that of the fit; inside[samples] of the fit
static bool is_alike(const fit_problem *p, const bool *inside)
{
    if (p->target->kind == SDM_FIT_POINTS) return false;
    size_t both = 0, sum = 0;
    for (size_t i = 0; i < p->samples.n; i++) {
        const bool now = is_inside(p, i);
        both += now && inside[i];
        sum += (size_t)now + (size_t)inside[i];
    }
    return 2 * (double)both >= ALIKE * (double)sum;
}

sdm_status sdm_fit_other_values(fit_problem *p, const bool *of, bool *found, sdm_error *err)
{
    const fit_state given = p->state;
    fit_state wide = given, best = given;
    fit_start list[N_KEPT];
    bool *inside = NULL;
    double axes[9];
    size_t n = 0;
    *found = false;
    sdm_fit_start_widen(p, &wide);
    // the objective of the fit, on the samples of the search
    p->use_tissue_field = false;
    p->samples.n_outside = 0;
    sdm_status s = sdm_fit_samples_near(p, SAMPLES_OF_KEPT, err);
    if (!s && p->samples.n) s = sdm_fit_evaluate(p, err);
    if (s || !p->samples.n) return s;
    // of every `stride`-th voxel, along each axis, or point fewer count as one
    const double fewer = pow((double)p->stride, p->target->kind == SDM_FIT_POINTS ? 1 : 3),
                 correlated = fmax(p->noise_factor / fewer, 1);
    double least = sdm_fit_objective(p) + GAIN_LEAST * correlated;
    s = SDM_ALLOC(&inside, p->samples.n, "start of the fit", err);
    for (size_t i = 0; i < p->samples.n && !s; i++) inside[i] = is_inside(p, i);
    if (!s) s = axes_find(p, axes, err);
    p->state = wide;
    if (!s) s = sdm_fit_evaluate(p, err);
    if (!s) s = values_rank(p, of, axes, LARGEST_SHIFT / N_SHIFTS * p->extent.reach, list, &n, err);
    for (size_t i = 0; i < n && !s; i++) {
        p->state = list[i].state;
        s = sdm_fit_start_continue(p, &given, true, err);
        if (!s && sdm_fit_objective(p) > least && !is_alike(p, inside))
            *found = true, least = sdm_fit_objective(p), best = p->state;
        if (s != SDM_E_NOMEM && s != SDM_E_CANCELLED) s = SDM_OK; // else it leads nowhere
    }
    sdm_free(inside);
    p->state = best;
    return s;
}
