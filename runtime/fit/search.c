/* Coarse to fine: a wide edge sees the surface from afar; every so many voxels are enough for it. */
#include "search.h"

#include <math.h>

// the wide edge: times the given one, but not above a share of the shape's reach
#define WIDER 3.0
#define WIDEST_SHARE 0.12
// voxels looked at
#define SITES_MOST 30000
#define POSE_STEPS 6
#define ALL_STEPS 12

#define PI 3.14159265358979324

// turn i of n about z, or super-Fibonacci spirals (Alexa 2022): quaternions evenly on the sphere
static void turn_of(sdm_fit_turns turns, size_t i, size_t n, double rotation[9])
{
    sdm_pose pose = {{0, 0, 0}, {0, 0, 0}};
    if (turns == SDM_FIT_TURNS_AXIS) pose.rotation[2] = 2 * PI * (double)i / (double)n;
    if (turns == SDM_FIT_TURNS_SPHERE && i > 0) { // the first is no turn
        const double phi = 1.4142135623730951, psi = 1.533751168755204288118041, s = (double)i + 0.5;
        const double t = s / (double)n, d = 2 * PI * s, r = sqrt(t), big = sqrt(1 - t);
        const double q[4] = {big * cos(d / psi), r * sin(d / phi), r * cos(d / phi), big * sin(d / psi)};
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

static double wide(double given, double reach) { return fmax(given, fmin(WIDER * given, WIDEST_SHARE * reach)); }

// a ball that holds every turn of the shape, and the stride that leaves few enough voxels of it
static sdm_status choose(fit_problem *p, sdm_error *err)
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
        for (int a = 0; a < 3; a++) box *= fmin((double)p->target->grid.n[a], 2 * region.radius / h[a] + 1);
        while (box / pow((double)p->stride, 3) > 2 * SITES_MOST) p->stride++;
    }
    bool changed;
    return sdm_fit_sites_choose(p->target, o, &region, p->stride, &p->sites, &changed, err);
}

static sdm_status nothing_near(const fit_problem *p, sdm_error *err)
{
    double x[3];
    sdm_fit_to_world(&p->state, p->extent.centre, x);
    if (p->sites.n_nan)
        return sdm_fail(
            err, SDM_E_ARG,
            "all %zu voxels of the image near the shape at the start (its middle at %.3g, %.3g, %.3g mm) are NaN "
            "or were left out as wide spaces: check the start pose, the cavity, and the values of the inside "
            "and the outside",
            p->sites.n_nan, x[0], x[1], x[2]);
    return sdm_fail(err, SDM_E_ARG,
                    "no voxel of the image lies near the shape at the start (its middle at %.3g, %.3g, %.3g mm): "
                    "check the start pose, the box and the frame of the image",
                    x[0], x[1], x[2]);
}

sdm_status sdm_fit_search(fit_problem *p, size_t *turn, sdm_error *err)
{
    const sdm_fit_opts *o = p->opts;
    fit_state start = p->state;
    *turn = 0;
    sdm_status s = choose(p, err);
    if (s) return s;
    if (!p->sites.n) return nothing_near(p, err);
    start.blur = wide(start.blur, p->extent.reach);
    start.l_ref = wide(start.l_ref, p->extent.reach);
    if (p->target->kind == SDM_FIT_POINTS) start.point_sd = fmax(start.point_sd, 0.1 * p->extent.reach);
    p->state = start;

    fit_run run = {.phase = SDM_FIT_SEARCH,
                   .keep_params = true,
                   .keep_pose = o->keep_pose,
                   .keep_blur = true,
                   .keep_look = true,
                   .max_iterations = POSE_STEPS,
                   .eps = 0.02};
    fit_ended ended;
    const size_t n = o->turns == SDM_FIT_TURNS_NONE || o->keep_pose ? 1 : o->n_turns;
    double best = -INFINITY;
    fit_state chosen = start;
    for (size_t i = 0; i < n && !s && n > 1; i++) {
        turn_start(p, i, &start, &p->state);
        p->prior = p->state; // each turn is a start of its own
        s = sdm_fit_iterate(p, &run, &ended, err);
        const double found = s ? best : p->sums.log_likelihood + sdm_fit_prior(p, &p->state, NULL, NULL, NULL);
        if (found > best) best = found, chosen = p->state, *turn = i;
    }
    if (s) return s;
    if (n > 1) turn_start(p, *turn, &start, &p->prior);
    p->state = chosen;
    run.keep_params = o->keep_params;
    run.max_iterations = ALL_STEPS;
    return sdm_fit_iterate(p, &run, &ended, err);
}
