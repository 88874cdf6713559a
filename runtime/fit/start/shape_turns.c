/* Turns of the fitted shape: by the cube of its axes, and evenly. Starts of fits to points: every
 * turn, improved by its pose alone, which needs no new map. */
#include "shape_turns.h"

#include <math.h>
#include <string.h>

#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "sdm/internal/mat3.h"
#include "start_search.h"
#include "turn_set.h"

// half turns: about the axes of the frame, the principal axes of the points, and those of the
// shape, which are the turns of the cube that follow the identity
#define N_HALF 9
// starts with rotations closer than this angle (rad) are the same
#define SAME_TURN 0.35
// of the other turns these many climb, besides the half turns
#define N_OTHER 6
// samples on which starts are ranked
#define SAMPLES_RANKED 600
// iterations of the pose: with the deviation of points of a search; with this multiple of that of
// the fit, which ranks the starts
#define STEPS 5
#define WIDER 3.0
// a turn whose log-likelihood is worse by this much for each sample than that of the pose of the
// fit, with the same parameters, leads nowhere
#define WORSE 0.25
// smallest change of a parameter, as a share of its range, that makes another shape
#define CHANGE_LEAST 0.02

// rotation i of the cube's: a permutation of the axes with signs, and no reflection; 0: identity
static void cube_rotation(size_t i, double r[9])
{
    static const int order[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1},
                                    {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
    const size_t which = i / 4;
    const double a = i & 1 ? -1 : 1, b = i & 2 ? -1 : 1, c = (which < 3 ? 1 : -1) * a * b,
                 sign[3] = {a, b, c};
    memset(r, 0, 9 * sizeof *r);
    for (int row = 0; row < 3; row++) r[3 * row + order[which][row]] = sign[row];
}

// *to = the shape of `from` turned by q in its frame, about centre[3]
static void turn_by(const fit_state *from, const double centre[3], const double q[9], fit_state *to)
{
    double at[3], moved[3];
    *to = *from;
    m3_product(from->rotation, q, to->rotation);
    sdm_fit_to_world(from, centre, at);
    sdm_fit_to_world(to, centre, moved);
    for (int k = 0; k < 3; k++) to->translation[k] += at[k] - moved[k];
}

void sdm_fit_shape_turned(const fit_state *from, const double centre[3], const double axes[9],
                          size_t i, fit_state *to)
{
    const double *v = axes, back[9] = {v[0], v[3], v[6], v[1], v[4], v[7], v[2], v[5], v[8]};
    double cube[9], half[9], q[9];
    if (i < FIT_TURNS_CUBE) {
        cube_rotation(i, cube);
        m3_product(back, cube, half);
        m3_product(half, v, q);
    } else if (i < FIT_TURNS_CUBE + FIT_TURNS_FOLD) {
        const size_t k = i - FIT_TURNS_CUBE, axis = k / 2;
        const double angle = (k % 2 ? 0.4 : 2.0 / 3) * acos(-1), *by = v + 3 * axis;
        const sdm_pose about = {.rotation = {angle * by[0], angle * by[1], angle * by[2]}};
        sdm_pose_matrix(&about, q);
    } else {
        sdm_fit_turn(SDM_FIT_TURNS_SPHERE, i - FIT_TURNS_CUBE - FIT_TURNS_FOLD, FIT_TURNS_EVEN, q);
    }
    turn_by(from, centre, q, to);
}

// axes[9]: rows, the principal axes of the samples, in the frame of the shape at the state of *p
static void sample_axes(const fit_problem *p, double axes[9])
{
    const fit_samples *s = &p->samples;
    double mean[3] = {0}, covariance[9] = {0}, spread[3], world[9];
    for (size_t i = 0; i < 3 * s->n; i++) mean[i % 3] += s->world[i] / (double)s->n;
    for (size_t i = 0; i < s->n; i++)
        for (size_t k = 0; k < 9; k++)
            covariance[k] +=
                (s->world[3 * i + k / 3] - mean[k / 3]) * (s->world[3 * i + k % 3] - mean[k % 3]);
    sdm_fit_eigen(3, covariance, spread, world);
    m3_product(world, p->state.rotation, axes); // rows: R^T of each
}

// *to = `from` after half turn i
static void half_turned(const fit_state *from, const double centre[3], const double axes[9],
                        const double of_points[9], size_t i, fit_state *to)
{
    static const double frame[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    const double *a = (i < 3 ? frame : i < 6 ? of_points : axes) + 3 * (i % 3);
    double q[9];
    for (int k = 0; k < 9; k++) q[k] = 2 * a[k / 3] * a[k % 3] - (k % 4 == 0);
    turn_by(from, centre, q, to);
}

// sets the parameters as sdm_fit_turned_starts() says; whether one changes
static bool params_set(const fit_problem *p, int params, double *values)
{
    bool changed = params == 0;
    for (size_t k = 0; k < p->n_params; k++) {
        const double low = p->low[k], high = p->high[k], was = values[k];
        if (fit_param_is_kept(p, k)) continue;
        if (params == 1 && (was <= low || was >= high)) values[k] = 0.5 * (low + high);
        if (params == 2) values[k] = p->prior.params[k];
        changed = changed || fabs(values[k] - was) > CHANGE_LEAST * (high - low);
    }
    return changed;
}

// improves the pose of the state of *p where the points have this deviation
static sdm_status pose_climb(fit_problem *p, double point_sd, sdm_error *err)
{
    const fit_newton_opts newton = {.phase = SDM_FIT_SEARCH,
                                    .keep_params = true,
                                    .keep_blur = true,
                                    .keep_appearance = true,
                                    .max_iterations = STEPS,
                                    .eps = 0.02};
    fit_newton_end end;
    p->state.point_sd = point_sd;
    return sdm_fit_newton(p, &newton, &end, err);
}

// inserts a start; of near ones the best alone stays
static void start_insert(const fit_start *one, fit_start *list, size_t *n, size_t most)
{
    size_t same = 0;
    while (same < *n &&
           sdm_fit_angle_between(list[same].state.rotation, one->state.rotation) >= SAME_TURN)
        same++;
    if (same < *n) {
        if (!(one->log_likelihood > list[same].log_likelihood)) return;
        for ((*n)--; same < *n; same++) list[same] = list[same + 1];
    }
    sdm_fit_start_insert(list, n, most, one);
}

// *end = the start `from`, improved by its pose alone; a log-likelihood of -INFINITY: leads nowhere
static sdm_status start_climb(fit_problem *p, const fit_state *from, double wide, double narrow,
                              fit_start *end, sdm_error *err)
{
    p->state = *from;
    sdm_status s = pose_climb(p, wide, err);
    if (!s) s = pose_climb(p, narrow, err);
    *end = (fit_start){.state = p->state, .log_likelihood = -INFINITY};
    if (!s) end->log_likelihood = p->information.log_likelihood;
    return s == SDM_E_QUALITY ? SDM_OK : s;
}

// the starts from `base`, at which *p is evaluated with its points `wide` off
static sdm_status starts_rank(fit_problem *p, const fit_state *base, double wide,
                              const double centre[3], const double axes[9], size_t most,
                              fit_start *list, size_t *n, sdm_error *err)
{
    const double narrow = WIDER * base->point_sd;
    double of_points[9];
    fit_start other[N_OTHER], here, end;
    fit_state turned;
    size_t n_other = 0;
    sample_axes(p, of_points);
    for (size_t i = 1; i < FIT_SHAPE_TURNS; i++) {
        fit_start one = {0};
        sdm_fit_shape_turned(base, centre, axes, i, &one.state);
        one.log_likelihood = sdm_fit_likelihood_at(p, &one.state, SAMPLES_RANKED);
        start_insert(&one, other, &n_other, N_OTHER);
    }
    sdm_status s = start_climb(p, base, wide, narrow, &here, err);
    const double least = here.log_likelihood - WORSE * (double)p->samples.n;
    for (size_t i = 0; i < N_HALF + n_other && !s; i++) {
        if (i < N_HALF)
            half_turned(base, centre, axes, of_points, i, &turned);
        else
            turned = other[i - N_HALF].state;
        s = start_climb(p, &turned, wide, narrow, &end, err);
        if (!s && end.log_likelihood > least) start_insert(&end, list, n, most);
    }
    return s;
}

sdm_status sdm_fit_turned_starts(fit_problem *p, const double centre[3], const double axes[9],
                                 int params, size_t most, fit_start *list, size_t *n,
                                 sdm_error *err)
{
    const sdm_fit_opts *given = p->opts;
    const int n_threads = p->maps.n_threads;
    const fit_state own = p->state;
    fit_state base = own;
    sdm_fit_opts alone = *given;
    *n = 0;
    if (!params_set(p, params, base.params)) return SDM_OK;
    sdm_status s = sdm_fit_samples_near(p, SAMPLES_RANKED, err);
    p->state = base;
    sdm_fit_start_widen(p, &p->state);
    const double wide = p->state.point_sd;
    if (!s) s = sdm_fit_evaluate(p, err);
    // so few samples take longer with threads
    p->opts = &alone, alone.n_threads = p->maps.n_threads = 1;
    if (!s) s = starts_rank(p, &base, wide, centre, axes, most, list, n, err);
    p->opts = given, p->maps.n_threads = n_threads;
    p->state = own;
    // without a shape for these parameters there is no start
    return s == SDM_E_NOMEM || s == SDM_E_CANCELLED ? s : SDM_OK;
}
