/* Finds parameters that act as a rigid motion, by their derivatives and by a finite change of each.
 */
#include "pose_params.h"

#include <math.h>
#include <string.h>

#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "fit/solver/prior.h"
#include "fit/solver/solve.h"
#include "sdm/internal/heap.h"

// A parameter is tried if the pose explains all but this share of its information. Derivatives by
// parameters and by the pose, both interpolated, differ by a few per cent, squared here.
#define REST_MAX 0.02
// the change of the parameter, as a share of its range; and a larger one
#define CHANGE 0.1
#define LARGER 4.0
// The data determine the parameter if the motion that is left grows in proportion to the change, to
// these factors, and is at least this share of the motion by the derivatives. Errors of
// interpolation and of the facets of a mesh do not grow; the motion at the edge of a surface grows
// faster.
#define GROWTH_MIN 0.7
#define GROWTH_MAX 1.4
#define AS_DERIVATIVES 0.5
// iterations that fit the pose, and their damping
#define ROUNDS 5
#define DAMPING 1e-3

// m[6] = change of the pose that undoes, to first order, a change of 1 of parameter k; returns the
// share of the information on the parameter that is left then. work: n n numbers
static double undo_first_order(const fit_problem *p, size_t k, double m[6], double *work)
{
    const size_t n = p->information.n_unknowns, at = fit_at_rotation(p->n_params);
    const double *complete = p->information.complete, own = complete[k * (n + 1)];
    double pose[36], factor[36], scale[6], explained = 0;
    memcpy(work, complete, n * n * sizeof *work);
    sdm_fit_add_weak_prior(p, work);
    sdm_fit_open_motions_stop(p, work);
    for (size_t i = 0; i < 6; i++) {
        m[i] = -complete[(at + i) * n + k];
        for (size_t j = 0; j < 6; j++) pose[6 * i + j] = work[(at + i) * n + at + j];
    }
    if (!(own > 0) || !sdm_fit_cholesky(6, pose, factor, scale)) return 1;
    sdm_fit_solve(6, factor, scale, m);
    for (size_t i = 0; i < 6; i++) explained -= m[i] * complete[(at + i) * n + k];
    return 1 - explained / own;
}

// one step of Gauss and Newton of the motion m[6], towards the field that the samples hold
static void undo_step(const fit_problem *p, double m[6])
{
    const fit_samples *s = &p->samples;
    double a[36] = {0}, step[6] = {0}, factor[36], scale[6];
    fit_state to;
    sdm_fit_move_along(&p->state, m, 1, &to);
    for (size_t i = 0; i < s->n; i++) {
        if (s->row[i] == SIZE_MAX) continue;
        const float *by = s->jacobian + s->row[i] * s->n_columns + fit_at_rotation(p->n_params);
        const double off = s->field[i] - sdm_fit_maps_at(&p->maps, &to, s->world + 3 * i);
        for (size_t x = 0; x < 6; x++) {
            step[x] += off * (double)by[x];
            for (size_t y = 0; y < 6; y++) a[6 * x + y] += (double)by[x] * (double)by[y];
        }
    }
    for (size_t x = 0; x < 6; x++) a[7 * x] *= 1 + DAMPING;
    if (!sdm_fit_cholesky(6, a, factor, scale)) return;
    sdm_fit_solve(6, factor, scale, step);
    for (size_t x = 0; x < 6; x++) m[x] += step[x];
}

// rms motion (mm) of the surface along its normal that a change of 1 of parameter k and the motion
// m[6] leave, by the derivatives
static double motion_by_derivatives(const fit_problem *p, size_t k, const double m[6])
{
    const fit_samples *s = &p->samples;
    double square = 0, slope = 0;
    for (size_t i = 0; i < s->n; i++) {
        if (s->row[i] == SIZE_MAX) continue;
        const float *column = s->jacobian + s->row[i] * s->n_columns;
        double left = (double)column[k];
        for (size_t x = 0; x < 6; x++)
            left += (double)column[fit_at_rotation(p->n_params) + x] * m[x];
        square += left * left;
        slope += sdm_fit_slope_squared(p, i);
    }
    return slope > 0 ? sqrt(square / slope) : 0;
}

// m[6], in: a motion that nearly undoes a change of 1 of parameter k; out: the one that best undoes
// `change`, per change of 1. *motion: the rms motion (mm) of the surface that is left. Overwrites
// p->maps
static sdm_status undo_finite(fit_problem *p, size_t k, double change, double m[6], double *motion,
                              sdm_error *err)
{
    double params[FIT_PARAMS_MAX];
    fit_state to;
    memcpy(params, p->state.params, sizeof params);
    params[k] += change;
    p->maps_params[0] = p->maps_blur = NAN;
    const sdm_status s = sdm_fit_maps_make(&p->maps, params, false, err);
    if (s) return s;
    sdm_fit_maps_pack(&p->maps, sdm_fit_field_blur(p), false);
    for (int i = 0; i < 6; i++) m[i] *= change;
    for (int round = 0; round < ROUNDS; round++) undo_step(p, m);
    sdm_fit_move_along(&p->state, m, 1, &to);
    *motion = sdm_fit_surface_motion(p, &to);
    for (int i = 0; i < 6; i++) m[i] /= change;
    return SDM_OK;
}

// *grows: whether the motion that is left grows in proportion from `motion`, left by `change`, to a
// larger change, and agrees with the derivatives; false where there is no shape. m[6]: the motion
// that undoes a change of 1
static sdm_status try_larger(fit_problem *p, size_t k, double change, double motion,
                             double by_derivatives, const double m[6], bool *grows, sdm_error *err)
{
    double undo[6], left = 0;
    memcpy(undo, m, sizeof undo);
    const sdm_status s = undo_finite(p, k, LARGER * change, undo, &left, err);
    const double growth = motion > 0 ? left / (LARGER * motion) : 0;
    *grows = !s && growth > GROWTH_MIN && growth < GROWTH_MAX &&
             left > AS_DERIVATIVES * by_derivatives * fabs(LARGER * change);
    return s == SDM_E_NOMEM || s == SDM_E_CANCELLED ? s : SDM_OK;
}

// whether a finite change of parameter k is a rigid motion; m[6]: then that which undoes a change
// of 1. Overwrites p->maps
static sdm_status try_finite(fit_problem *p, size_t k, double m[6], bool *rigid, sdm_error *err)
{
    const double by_derivatives = motion_by_derivatives(p, k, m);
    double change = CHANGE * (p->high[k] - p->low[k]), motion;
    if (p->state.params[k] - p->low[k] > p->high[k] - p->state.params[k]) change = -change;
    sdm_status s = undo_finite(p, k, change, m, &motion, err);
    if (s) return s;
    *rigid = motion < FIT_MOTION_MIN * fit_longest_edge(&p->maps.grid);
    bool grows = false;
    if (*rigid) s = try_larger(p, k, change, motion, by_derivatives, m, &grows, err);
    if (grows) *rigid = false;
    return s;
}

sdm_status sdm_fit_pose_params_find(fit_problem *p, sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    bool tried = false;
    double *work = NULL;
    p->n_pose_params = 0;
    if (p->opts->keep_params || p->opts->keep_pose || !p->samples.n_band) return SDM_OK;
    sdm_status s = SDM_ALLOC(&work, n * n, "matrices of the fit", err);
    for (size_t k = 0; k < p->n_params && p->n_pose_params < FIT_MOTIONS_MAX && !s; k++) {
        fit_pose_param *found = &p->pose_param[p->n_pose_params];
        bool rigid = false;
        if (fit_param_is_kept(p, k)) continue;
        found->param = k;
        if (undo_first_order(p, k, found->motion, work) > REST_MAX) continue;
        tried = true;
        s = try_finite(p, k, found->motion, &rigid, err);
        p->n_pose_params += rigid;
    }
    sdm_free(work);
    return s || !tried ? s : sdm_fit_evaluate(p, err);
}

// variance along a direction that changes the parameter by 1, by the priors alone
static double variance_before(const fit_problem *p, const fit_pose_param *one)
{
    const double turn = p->opts->prior_rotation_sd, shift = p->opts->prior_translation_sd;
    double precision = 1 / pow(sdm_fit_prior_sd(p, one->param), 2);
    for (int i = 0; i < 3; i++) {
        if (turn > 0) precision += pow(one->motion[i] / turn, 2);
        if (shift > 0) precision += pow(one->motion[i + 3] / shift, 2);
    }
    return 1 / precision;
}

void sdm_fit_pose_params_spread(const fit_problem *p, double *c)
{
    const size_t size = p->n_params + 6;
    for (size_t k = 0; k < p->n_pose_params; k++) {
        const fit_pose_param *one = &p->pose_param[k];
        const double more = variance_before(p, one) - c[one->param * (size + 1)];
        double d[FIT_PARAMS_MAX + 6] = {0};
        if (!(more > 0)) continue;
        d[one->param] = 1;
        memcpy(d + p->n_params, one->motion, sizeof one->motion);
        for (size_t i = 0; i < size; i++)
            for (size_t j = 0; j < size; j++) c[i * size + j] += more * d[i] * d[j];
    }
}
