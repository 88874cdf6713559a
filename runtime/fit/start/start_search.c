/* Coarse-to-fine search for the start. A "turn" is one of the rotations of the start pose that are
   tried. With a wide point spread the fit finds the surface from a distance, and a subsample of the
   voxels is enough. Each turn is fitted with pose and shape parameters: with the parameters of the
   start, a shape of another size would fit best in a wrong pose. */
#include "start_search.h"

#include <math.h>

#include "coarse_maps.h"
#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/vec3.h"
#include "turn_set.h"

// sd of the wide point spread: WIDER times the given one, but at most WIDEST_SHARE times the
// shape's reach
#define WIDER 3.0
#define WIDEST_SHARE 0.12
// number of samples: for every turn, and for the turns that continue
#define SAMPLES_OF_TURNS 10000
#define SAMPLES_OF_KEPT 30000
// largest number of iterations: of every turn; of a turn that continues, with the wide point
// spread; of the same turn with the given point spread
#define TURN_STEPS 10
#define KEPT_STEPS 12
#define SHARP_STEPS 6
// largest number of turns that continue; turns that end at rotations closer than this angle (rad)
// count as the same
#define TURNS_KEPT 4
#define SAME_TURN 0.35

// the start with turn i: R = R_start Q, and t such that the pivot stays in place
static void turn_start(const fit_problem *p, size_t i, const fit_state *start, fit_state *out)
{
    const sdm_fit_opts *o = p->opts;
    double q[9], at[3], moved[3];
    sdm_fit_turn(o->turns, i, o->n_turns, q);
    *out = *start;
    m3_product(start->rotation, q, out->rotation);
    sdm_fit_to_world(start, o->pivot, at);
    sdm_fit_to_world(out, o->pivot, moved);
    for (int k = 0; k < 3; k++) out->translation[k] += at[k] - moved[k];
}

static double widened(double given, double reach)
{
    return fmax(given, fmin(WIDER * given, WIDEST_SHARE * reach));
}

sdm_status sdm_fit_samples_near(fit_problem *p, double wanted, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool turns = o->turns != SDM_FIT_TURNS_NONE;
    fit_region region = {.radius = p->extent.reach + o->margin};
    sdm_fit_to_world(&p->state, turns ? o->pivot : p->extent.centre, region.centre);
    if (turns) region.radius += sqrt(v3_dist2(o->pivot, p->extent.centre));
    p->stride = 1;
    if (p->target->kind == SDM_FIT_POINTS) {
        while ((double)p->target->n_points / (double)p->stride > 1.5 * wanted) p->stride++;
    } else {
        const double *h = p->target->grid.spacing;
        double box = 1; // voxels of the ball's bounding box in the image
        for (int a = 0; a < 3; a++)
            box *= fmin((double)p->target->grid.n[a], 2 * region.radius / h[a] + 1);
        while (box / pow((double)p->stride, 3) > 2 * wanted) p->stride++;
    }
    bool changed;
    sdm_status s =
        sdm_fit_samples_choose(p->target, o, &region, p->stride, &p->samples, &changed, err);
    // If voxels that are NaN repeat with the stride (every second slice, say), most samples are
    // NaN; a smaller stride finds other voxels.
    while (!s && p->samples.n < p->samples.n_nan && p->stride > 1) {
        p->stride--;
        s = sdm_fit_samples_choose(p->target, o, &region, p->stride, &p->samples, &changed, err);
    }
    return s;
}

// error: no sample near the start
static sdm_status no_samples(const fit_problem *p, sdm_error *err)
{
    double x[3];
    sdm_fit_to_world(&p->state, p->extent.centre, x);
    if (p->samples.n_nan)
        return sdm_fail(err, SDM_E_ARG,
                        "all %zu voxels of the image near the shape at the start (its middle at "
                        "%.3g, %.3g, %.3g mm) are NaN or were left out as wide spaces: check the "
                        "start pose, the cavity, and the values of the inside and the outside",
                        p->samples.n_nan, x[0], x[1], x[2]);
    return sdm_fail(err, SDM_E_ARG,
                    "no voxel of the image lies near the shape at the start (its middle at %.3g, "
                    "%.3g, %.3g mm): check the start pose, the box and the frame of the image",
                    x[0], x[1], x[2]);
}

/* The best turns so far and the states in which they ended, the best first. */
typedef struct found_turns {
    size_t n, turn[TURNS_KEPT];
    double objective[TURNS_KEPT];
    fit_state state[TURNS_KEPT];
} found_turns;

static void turns_move(found_turns *f, size_t from, size_t to)
{
    f->turn[to] = f->turn[from];
    f->objective[to] = f->objective[from];
    f->state[to] = f->state[from];
}

// inserts a turn if it is among the best; of turns that end at the same rotation only the best
// stays
static void turns_insert(found_turns *f, size_t turn, double objective, const fit_state *state)
{
    if (!(objective > -INFINITY)) return;
    size_t same = 0;
    while (same < f->n &&
           !(sdm_fit_angle_between(f->state[same].rotation, state->rotation) < SAME_TURN))
        same++;
    if (same < f->n) {
        if (objective <= f->objective[same]) return;
        for (f->n--; same < f->n; same++) turns_move(f, same + 1, same);
    }
    size_t at = f->n < TURNS_KEPT ? f->n++ : TURNS_KEPT;
    for (; at > 0 && f->objective[at - 1] < objective; at--)
        if (at < TURNS_KEPT) turns_move(f, at - 1, at);
    if (at == TURNS_KEPT) return;
    f->turn[at] = turn;
    f->objective[at] = objective;
    f->state[at] = *state;
}

// for progress(): start i, from 0, of n in a round; 0 of 0 in round 0: the search has ended
static void search_at(fit_problem *p, size_t round, size_t i, size_t n)
{
    p->search_round = round;
    p->search_start = n ? i + 1 : 0;
    p->search_starts = n;
    if (i == 0) p->search_best = NULL;
}

// the fit from a start that was not chosen becomes the runner-up if it explains the data better
// than the present one
static void runner_up_set(fit_problem *p, double objective, const fit_state *state)
{
    if (!(objective > -INFINITY) || (p->has_runner_up && objective <= p->runner_up_objective))
        return;
    p->has_runner_up = true;
    p->runner_up_objective = objective;
    p->runner_up = *state;
}

void sdm_fit_start_widen(const fit_problem *p, fit_state *state)
{
    state->blur = widened(state->blur, p->extent.reach);
    state->l_ref = widened(state->l_ref, p->extent.reach);
    if (p->target->kind == SDM_FIT_POINTS)
        state->point_sd = fmax(state->point_sd, 0.1 * p->extent.reach);
}

// of a search: all unknowns move but point spread and appearance, and what the options keep
static fit_newton_opts search_steps(const fit_problem *p, size_t steps)
{
    return (fit_newton_opts){.phase = SDM_FIT_SEARCH,
                             .keep_params = p->opts->keep_params,
                             .keep_pose = p->opts->keep_pose,
                             .keep_blur = true,
                             .keep_appearance = true,
                             .max_iterations = steps,
                             .eps = 0.02};
}

sdm_status sdm_fit_start_continue(fit_problem *p, const fit_state *given, bool sharp,
                                  sdm_error *err)
{
    const fit_newton_opts wide = search_steps(p, KEPT_STEPS), narrow = search_steps(p, SHARP_STEPS);
    fit_newton_end end;
    fit_maps fine;
    sdm_status s = sdm_fit_coarse_maps_begin(p, &fine, err);
    if (!s) s = sdm_fit_newton(p, &wide, &end, err);
    sdm_fit_coarse_maps_end(p, &fine);
    p->state.blur = given->blur;
    p->state.l_ref = given->l_ref;
    p->state.point_sd = given->point_sd;
    if (!s && sharp) s = sdm_fit_newton(p, &narrow, &end, err);
    return s;
}

sdm_status sdm_fit_start_search(fit_problem *p, size_t *turn, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const fit_state given = p->state;
    fit_state start = given;
    // samples near the start
    *turn = 0;
    const size_t n = o->turns == SDM_FIT_TURNS_NONE || o->keep_pose ? 1 : o->n_turns;
    sdm_status s = sdm_fit_samples_near(p, n > 1 ? SAMPLES_OF_TURNS : SAMPLES_OF_KEPT, err);
    if (s) return s;
    if (!p->samples.n) return no_samples(p, err);
    // one start, or every turn, with a wide point spread
    sdm_fit_start_widen(p, &start);
    p->state = start;

    // fit the shape from each turn of the start pose
    const fit_newton_opts newton = search_steps(p, TURN_STEPS);
    fit_newton_end end;
    found_turns found = {.n = n == 1, .state = {start}};
    fit_maps fine;
    s = sdm_fit_coarse_maps_begin(p, &fine, err);
    for (size_t i = 0; i < n && !s && n > 1; i++) {
        search_at(p, 1, i, n);
        turn_start(p, i, &start, &p->state);
        p->prior = p->state; // the prior is centred on the start of the turn
        s = sdm_fit_newton(p, &newton, &end, err);
        if (!s) turns_insert(&found, i, sdm_fit_objective(p), &p->state);
        if (found.n) p->search_best = found.state[0].params;
    }
    sdm_fit_coarse_maps_end(p, &fine);
    // with a wide point spread a wrong turn may look best: so several turns continue, in the end
    // with the given point spread
    if (n > 1 && !s) {
        p->state = start;
        s = sdm_fit_samples_near(p, SAMPLES_OF_KEPT, err);
    }
    // the turns that continue, or the one start
    double best = -INFINITY;
    fit_state chosen = given;
    for (size_t i = 0; i < found.n && !s; i++) {
        if (n > 1) search_at(p, 2, i, found.n);
        p->state = found.state[i];
        if (n > 1) turn_start(p, found.turn[i], &start, &p->prior);
        s = sdm_fit_start_continue(p, &given, n > 1, err);
        const double objective = s ? best : sdm_fit_objective(p);
        if (objective > best) {
            if (best > -INFINITY) runner_up_set(p, best, &chosen);
            best = objective, chosen = p->state, *turn = found.turn[i];
        } else {
            runner_up_set(p, objective, &p->state);
        }
        if (best > -INFINITY) p->search_best = chosen.params;
    }
    search_at(p, 0, 0, 0);
    if (s) return s;
    // the best start
    p->state = chosen;
    if (n > 1) turn_start(p, *turn, &start, &p->prior);
    return SDM_OK;
}
