/* Coarse to fine: a wide edge sees the surface from afar; every so many voxels are enough for it.
   Every turn goes with all unknowns: a shape of another size than that of the start fits best where
   it does not belong. */
#include "start_search.h"
#include "sdm/internal/rotation.h"

#include <math.h>

// the wide edge: times the given one, but not above a share of the shape's reach
#define WIDER 3.0
#define WIDEST_SHARE 0.12
// voxels looked at, by every turn and by those that are gone on with
#define SITES_OF_TURNS 10000
#define SITES_OF_KEPT 30000
#define TURN_STEPS 10
#define KEPT_STEPS 12
#define SHARP_STEPS 6
// turns that are gone on with, and the angle (rad) below which two have found the same
#define TURNS_KEPT 4
#define SAME_TURN 0.35

#define PI 3.14159265358979324

// turn i of n about z, or super-Fibonacci spirals (Alexa 2022): quaternions evenly on the sphere
static void turn_of(sdm_fit_turns turns, size_t i, size_t n, double rotation[9])
{
    sdm_pose pose = {{0, 0, 0}, {0, 0, 0}};
    if (turns == SDM_FIT_TURNS_AXIS) pose.rotation[2] = 2 * PI * (double)i / (double)n;
    if (turns == SDM_FIT_TURNS_SPHERE && i > 0) { // the first is no turn
        const double phi = 1.4142135623730951, psi = 1.533751168755204288118041,
                     s = (double)i + 0.5;
        const double t = s / (double)n, d = 2 * PI * s, r = sqrt(t), big = sqrt(1 - t);
        const double q[4] = {big * cos(d / psi), r * sin(d / phi), r * cos(d / phi),
                             big * sin(d / psi)};
        sdm_rotation_of_quaternion(q, pose.rotation);
    }
    sdm_pose_matrix(&pose, rotation);
}

// the start turned about the pivot: R = R0 Q, t so that the pivot stays
static void turn_start(const fit_problem *p, size_t i, const fit_state *start, fit_state *out)
{
    const sdm_fit_opts *o = p->opts;
    double q[9], at[3], moved[3];
    turn_of(o->turns, i, o->n_turns, q);
    *out = *start;
    sdm_rotation_product(start->rotation, q, out->rotation);
    sdm_fit_to_world(start, o->pivot, at);
    sdm_fit_to_world(out, o->pivot, moved);
    for (int k = 0; k < 3; k++) out->translation[k] += at[k] - moved[k];
}

static double wide(double given, double reach)
{
    return fmax(given, fmin(WIDER * given, WIDEST_SHARE * reach));
}

// a ball that holds every turn of the shape, and the stride that leaves few enough voxels of it
static sdm_status choose(fit_problem *p, double most, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const bool turns = o->turns != SDM_FIT_TURNS_NONE;
    fit_region region = {.radius = p->extent.reach + o->margin};
    sdm_fit_to_world(&p->state, turns ? o->pivot : p->extent.centre, region.centre);
    double off = 0;
    for (int k = 0; turns && k < 3; k++)
        off += (o->pivot[k] - p->extent.centre[k]) * (o->pivot[k] - p->extent.centre[k]);
    region.radius += sqrt(off);
    p->stride = 1;
    if (p->target->kind != SDM_FIT_POINTS) {
        const double *h = p->target->grid.spacing;
        double box = 1; // voxels of the ball that can be in the image
        for (int a = 0; a < 3; a++)
            box *= fmin((double)p->target->grid.n[a], 2 * region.radius / h[a] + 1);
        while (box / pow((double)p->stride, 3) > 2 * most) p->stride++;
    }
    bool changed;
    return sdm_fit_sites_choose(p->target, o, &region, p->stride, &p->sites, &changed, err);
}

static sdm_status nothing_near(const fit_problem *p, sdm_error *err)
{
    double x[3];
    sdm_fit_to_world(&p->state, p->extent.centre, x);
    if (p->sites.n_nan)
        return sdm_fail(err, SDM_E_ARG,
                        "all %zu voxels of the image near the shape at the start (its middle at "
                        "%.3g, %.3g, %.3g mm) are NaN "
                        "or were left out as wide spaces: check the start pose, the cavity, and "
                        "the values of the inside "
                        "and the outside",
                        p->sites.n_nan, x[0], x[1], x[2]);
    return sdm_fail(err, SDM_E_ARG,
                    "no voxel of the image lies near the shape at the start (its middle at %.3g, "
                    "%.3g, %.3g mm): "
                    "check the start pose, the box and the frame of the image",
                    x[0], x[1], x[2]);
}

static double objective_of(const fit_problem *p)
{
    return p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
}

/* Where turns have led, the best first. */
typedef struct found_turns {
    size_t n, turn[TURNS_KEPT];
    double objective[TURNS_KEPT];
    fit_state state[TURNS_KEPT];
} found_turns;

static double angle_between(const double a[9], const double b[9])
{
    double trace = 0;
    for (int i = 0; i < 9; i++) trace += a[i] * b[i];
    return acos(fmax(fmin(0.5 * (trace - 1), 1), -1));
}

static void move_turn(found_turns *f, size_t from, size_t to)
{
    f->turn[to] = f->turn[from];
    f->objective[to] = f->objective[from];
    f->state[to] = f->state[from];
}

// keeps the state that a turn has led to if it is one of the best; of those that found the same the
// best alone
static void keep_turn(found_turns *f, size_t turn, double objective, const fit_state *state)
{
    if (!(objective > -INFINITY)) return;
    size_t same = 0;
    while (same < f->n && !(angle_between(f->state[same].rotation, state->rotation) < SAME_TURN))
        same++;
    if (same < f->n) {
        if (objective <= f->objective[same]) return;
        for (f->n--; same < f->n; same++) move_turn(f, same + 1, same);
    }
    size_t at = f->n < TURNS_KEPT ? f->n++ : TURNS_KEPT;
    for (; at > 0 && f->objective[at - 1] < objective; at--)
        if (at < TURNS_KEPT) move_turn(f, at - 1, at);
    if (at == TURNS_KEPT) return;
    f->turn[at] = turn;
    f->objective[at] = objective;
    f->state[at] = *state;
}

sdm_status sdm_fit_search(fit_problem *p, size_t *turn, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    const fit_state given = p->state;
    fit_state start = given;
    *turn = 0;
    const size_t n = o->turns == SDM_FIT_TURNS_NONE || o->keep_pose ? 1 : o->n_turns;
    sdm_status s = choose(p, n > 1 ? SITES_OF_TURNS : SITES_OF_KEPT, err);
    if (s) return s;
    if (!p->sites.n) return nothing_near(p, err);
    start.blur = wide(start.blur, p->extent.reach);
    start.l_ref = wide(start.l_ref, p->extent.reach);
    if (p->target->kind == SDM_FIT_POINTS)
        start.point_sd = fmax(start.point_sd, 0.1 * p->extent.reach);
    p->state = start;

    fit_run run = {.phase = SDM_FIT_SEARCH,
                   .keep_params = o->keep_params,
                   .keep_pose = o->keep_pose,
                   .keep_blur = true,
                   .keep_look = true,
                   .max_iterations = TURN_STEPS,
                   .eps = 0.02};
    fit_ended ended;
    found_turns found = {.n = n == 1, .state = {start}};
    for (size_t i = 0; i < n && !s && n > 1; i++) {
        turn_start(p, i, &start, &p->state);
        p->prior = p->state; // each turn is a start of its own
        s = sdm_fit_iterate(p, &run, &ended, err);
        if (!s) keep_turn(&found, i, objective_of(p), &p->state);
    }
    // seen from afar another turn than the right one may be the best: several go on, at last with
    // the edge as it is
    if (n > 1 && !s) {
        p->state = start;
        s = choose(p, SITES_OF_KEPT, err);
    }
    double best = -INFINITY;
    fit_state chosen = given;
    for (size_t i = 0; i < found.n && !s; i++) {
        p->state = found.state[i];
        if (n > 1) turn_start(p, found.turn[i], &start, &p->prior);
        run.max_iterations = KEPT_STEPS;
        s = sdm_fit_iterate(p, &run, &ended, err);
        p->state.blur = given.blur;
        p->state.l_ref = given.l_ref;
        p->state.point_sd = given.point_sd;
        run.max_iterations = SHARP_STEPS;
        if (!s && n > 1) s = sdm_fit_iterate(p, &run, &ended, err);
        const double objective = s ? best : objective_of(p);
        if (objective > best) best = objective, chosen = p->state, *turn = found.turn[i];
    }
    if (s) return s;
    p->state = chosen;
    if (n > 1) turn_start(p, *turn, &start, &p->prior);
    return SDM_OK;
}
