/* Rivals of the fit: the fitted shape in other poses (a list of rotations), and the shape with
 * another value of one parameter; the likelihood of each, and the maximum next to the best ones. */
#include "next_pose.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "finding.h"
#include "fit/data/source_params.h"
#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "fit/solver/prior.h"
#include "fit/start/principal_axes.h"
#include "fit/start/shape_turns.h"
#include "fit/start/start_list.h"
#include "fit/start/start_search.h"
#include "fit/start/turn_set.h"
#include "rival.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "sdm/internal/vec3.h"

// log-likelihood by which another shape or pose must be better to refuse a fit to points
#define CLEARLY_BETTER 30.0
// a surface that has this Dice coefficient with the surface of the fit is no rival
#define ALIKE 0.9
// a turn to a surface with a higher one is a symmetry of the shape, up to the voxels of the map, if
// no part of the surfaces lies farther apart than this many voxels: a small collar may be all that
// tells the front from the back
#define SYMMETRIC 0.9875
#define APART 1.5
// a rival that ends with a higher one has the surface of the fit
#define SAME 0.975
// turns by less than this, rad, are no symmetries
#define SYMMETRIC_MIN 0.7
// in such a pose mean square residuals are lower than those of the fit by at least this factor
#define BETTER 1.2
// turns to a surface between the two, from which the fit may end at a better maximum: an
// upside-down bone
#define ALIKE_TRIED 2
// Fits to points: TURNED_MOST starts of sdm_fit_turned_starts() are listed for each of its three
// choices of parameters. The best of them are improved with all unknowns: TURNED_TRIED with the
// parameters of the fit, TURNED_TRIED_OTHERWISE with each of the two others.
#define TURNED_MOST 8
#define TURNED_TRIED 2
#define TURNED_TRIED_OTHERWISE 1
#define CLIMBS_MAX (TURNED_TRIED + 2 * TURNED_TRIED_OTHERWISE)
// voxels of the shape by which surfaces are compared
#define VOXELS_ALIKE 1000
// samples on which fit and rivals are compared, and on which all rotations are
#define SAMPLES 10000
#define SAMPLES_RANKED 2000
// iterations from a start of a rival, and from the fit
#define STEPS 10
#define STEPS_OF_FIT 2
// rotations from which the fit may return to its own pose before the search is given up
#define TRIES_MAX 3
// values of a parameter that are tried: the middles of this many equal parts of its range, without
// those nearer to the value of the fit than half of a part
#define N_PARTS 3
// parameters with another value of which rivals start
#define PARAMS_TRIED 2

// advice where a rival explains the data better: start the next fit there or, after a fit from
// there has lost, keep known values
static const char FROM_VALUE[] = "start from this value (sdm_fit_opts.start_params)",
                  FROM_POSE[] = "start from this pose, or try more turns",
                  TRIED[] = "a fit that began there did not stay: keep what is known "
                            "(sdm_fit_opts.kept)";

/* The rival with the least gain of the fit over it; NaN: there is none. */
typedef struct nearest {
    double gain;
    size_t param;       /* as fit_start.param */
    double value;       /* of this parameter */
    double rotation[3]; /* rotation vector of the shape, rad */
    fit_state state;
    bool open;          /* a pose that explains the data as well was left out, because it differs
                           from the fit along directions alone that the fit calls not determined */
    char symmetry[240]; /* how the surface may be turned and stays the same; "": not at all */
} nearest;

/* The fit, with which its rivals are compared. */
typedef struct own_fit {
    const fit_problem *p;
    const sdm_fit_result *result;
    fit_state state;
    double *distance; /* [n_voxels] map of the shape, mm */
    double volume;    /* see volume_of() */
    double centre[3]; /* of its inside, in its frame, mm */
    double axes[9];   /* rows: its principal axes */
    double factor;    /* as fit_standing, for the present samples */
    /* after some iterations on these samples, as its rivals have: how it stands, and its field
     * there; NULL: not known yet */
    fit_standing standing;
    double *field;
    /* whose progress() hears of the rivals: how many were begun, of at most `all` */
    const sdm_fit_opts *told;
    size_t begun, all;
} own_fit;

// reports that the next rival begins
static void tell_rival(fit_problem *p, own_fit *own)
{
    const sdm_fit_opts *quiet = p->opts;
    p->opts = own->told;
    p->search_start = ++own->begun, p->search_starts = own->all;
    sdm_fit_tell_progress(p, SDM_FIT_JUDGE, 0);
    p->search_start = p->search_starts = 0;
    p->opts = quiet;
}

static void place_of(const sdm_grid *g, size_t v, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    sdm_grid_world(
        g, (const double[3]){(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)}, x);
}

// The part of a voxel of a map that lies inside, as seen by the distance at its centre: so thin
// parts count by their volume, wherever the voxels lie.
static double part_inside(const fit_maps *m, double distance)
{
    return fmin(fmax(0.5 - distance / fit_longest_edge(&m->grid), 0), 1);
}

// the volume, in voxels, of the shape with the map distance[n_voxels]
static double volume_of(const fit_maps *m, const double *distance)
{
    double sum = 0;
    for (size_t v = 0; v < m->n_voxels; v++) sum += part_inside(m, distance[v]);
    return sum;
}

static sdm_status own_create(const fit_problem *p, own_fit *own, sdm_error *err)
{
    const fit_maps *m = &p->maps;
    fit_extent e;
    *own = (own_fit){.p = p, .state = p->state};
    sdm_status s = sdm_fit_extent(m, &e, err);
    if (!s) s = SDM_ALLOC(&own->distance, m->n_voxels, "rival of the fit", err);
    if (s) return s;
    memcpy(own->centre, e.centre, sizeof own->centre);
    memcpy(own->distance, m->distance, m->n_voxels * sizeof *m->distance);
    own->volume = volume_of(m, m->distance);
    sdm_fit_principal_axes(m, own->centre, own->axes);
    return SDM_OK;
}

/* How much another surface is like the surface of the fit. */
typedef struct likeness {
    double dice;  // Dice coefficient of the volumes
    double apart; // largest difference of the distances in the fit and at its surface, voxels
} likeness;

// compares the fit with the shape that has the map distance[n_voxels] and this volume, in the state
// `other`
static likeness compare(const own_fit *own, const double *distance, double volume,
                        const fit_state *other)
{
    const fit_maps *m = &own->p->maps;
    const fit_field f = {.grid = &m->grid, .packed = distance, .n_fields = 1, .distance = true};
    const size_t step = (size_t)(own->volume / VOXELS_ALIKE) + 1;
    double x[3], world[3], both = 0, tried = 0;
    likeness like = {0};
    size_t seen = 0;
    for (size_t v = 0; v < m->n_voxels; v++) {
        const double part = part_inside(m, own->distance[v]);
        if (!(part > 0) || seen++ % step) continue;
        place_of(&m->grid, v, x);
        sdm_fit_to_world(&own->state, x, world);
        const double there = sdm_fit_field_at(&f, other, world);
        tried += part;
        both += fmin(part, part_inside(m, there));
        like.apart = fmax(like.apart, fabs(there - own->distance[v]));
    }
    like.apart /= fit_longest_edge(&m->grid);
    if (tried > 0) like.dice = 2 * (both / tried) * own->volume / (own->volume + volume);
    return like;
}

// the same of the fit and of the shape with the latest map in the state `other`
static likeness compare_map(const own_fit *own, const fit_maps *m, const fit_state *other)
{
    return compare(own, m->distance, volume_of(m, m->distance), other);
}

/* The turns from which rivals start, the best first. */
typedef struct turns {
    fit_start other[FIT_SHAPE_TURNS]; // to other surfaces, with the parameters of the fit
    fit_start alike[ALIKE_TRIED];     // to surfaces that are nearly that of the fit, all free
    size_t n_other, n_alike;
    // the turn by at least SYMMETRIC_MIN to the most similar surface, if it is the same; same.dice
    // 0: there is none
    struct {
        double dice, rotation[3]; // rotation vector in the world, rad
    } same;
} turns;

// keeps the turn of the fit to the same surface, if it is a large one
static void same_take(const own_fit *own, const fit_state *to, double dice, turns *t)
{
    double back[9], turn[9], v[3];
    const double *r = own->state.rotation;
    for (int i = 0; i < 9; i++) back[i] = r[3 * (i % 3) + i / 3];
    m3_product(to->rotation, back, turn);
    sdm_rotation_vector(turn, v);
    if (!(v3_norm(v) >= SYMMETRIC_MIN) || !(dice > t->same.dice)) return;
    t->same.dice = dice;
    memcpy(t->same.rotation, v, sizeof v);
}

static void turns_rank(const own_fit *own, turns *t)
{
    t->n_other = t->n_alike = 0;
    t->same.dice = 0;
    for (size_t i = 0; i < FIT_SHAPE_TURNS; i++) {
        fit_start one = {0};
        sdm_fit_shape_turned(&own->state, own->centre, own->axes, i, &one.state);
        const likeness like = compare(own, own->distance, own->volume, &one.state);
        if (like.dice > SYMMETRIC && like.apart < APART) {
            same_take(own, &one.state, like.dice, t);
            continue;
        }
        one.log_likelihood = sdm_fit_likelihood_at(own->p, &one.state, SAMPLES_RANKED);
        one.keep_params = like.dice <= ALIKE;
        if (one.keep_params)
            sdm_fit_start_insert(t->other, &t->n_other, FIT_SHAPE_TURNS, &one);
        else
            sdm_fit_start_insert(t->alike, &t->n_alike, ALIKE_TRIED, &one);
    }
}

// from the state of *p to the nearest maximum, for some iterations
static sdm_status climb(fit_problem *p, bool keep_params, size_t steps, sdm_error *err)
{
    const fit_newton_opts newton = {.phase = SDM_FIT_SEARCH,
                                    .keep_params = keep_params || p->opts->keep_params,
                                    .keep_blur = true,
                                    .keep_appearance = p->opts->keep_appearance,
                                    .max_iterations = steps,
                                    .eps = 0.02};
    fit_newton_end end;
    return sdm_fit_newton(p, &newton, &end, err);
}

// how well the state of *p explains the samples after some iterations; *other: its surface is
// another one than the fit's, less like it than `most`
static sdm_status challenge(fit_problem *p, const own_fit *own, const fit_start *from,
                            likeness most, bool *other, fit_standing *standing, sdm_error *err)
{
    p->state = from->state;
    sdm_status s = climb(p, from->keep_params, STEPS, err);
    if (!s) s = sdm_fit_maps_voxels(&p->maps, err);
    const likeness like = s ? most : compare_map(own, &p->maps, &p->state);
    *other = !s && (like.dice <= most.dice || like.apart > most.apart);
    if (s == SDM_E_QUALITY) return SDM_OK; // a state that cannot be fitted is no rival
    if (!s) s = sdm_fit_stand(p, own->factor, standing, err);
    // where the data tell little, a maximum is wide, and it holds surfaces that differ
    if (!s && *other && own->field)
        *other = !sdm_fit_same_maximum(p, &own->standing, own->field, standing);
    return s;
}

// *best = the value of parameter k, of those that are tried, with which the shape explains the
// samples best, in the pose of the fit; best->param 0: none gives another surface
static sdm_status value_find(fit_problem *p, const own_fit *own, size_t k, fit_start *best,
                             sdm_error *err)
{
    const double range = p->high[k] - p->low[k], here = own->state.params[k];
    *best = (fit_start){.log_likelihood = -INFINITY};
    for (int i = 0; i < N_PARTS; i++) {
        fit_start one = {.state = own->state, .param = k + 1};
        one.state.params[k] = p->low[k] + (i + 0.5) / N_PARTS * range;
        if (fabs(one.state.params[k] - here) < 0.5 / N_PARTS * range) continue;
        sdm_status s = sdm_fit_log_likelihood(p, one.state.params, &one.log_likelihood, err);
        if (!s && !(one.log_likelihood > best->log_likelihood)) continue;
        if (!s) s = sdm_fit_maps_voxels(&p->maps, err);
        if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return s;
        // parameters without a shape are no rival
        if (!s && compare_map(own, &p->maps, &one.state).dice <= ALIKE) *best = one;
    }
    return SDM_OK;
}

// list[PARAMS_TRIED] = the parameters whose best other values explain the samples best; *n: how
// many. The state of *p is that of the fit
static sdm_status values_rank(fit_problem *p, own_fit *own, fit_start *list, size_t *n,
                              sdm_error *err)
{
    sdm_status s = SDM_OK;
    *n = 0;
    for (size_t k = 0; k < p->n_params && !s; k++) {
        if (fit_param_is_kept(p, k)) continue;
        fit_start one;
        tell_rival(p, own);
        s = value_find(p, own, k, &one, err);
        if (!s && one.param) sdm_fit_start_insert(list, n, PARAMS_TRIED, &one);
    }
    return s;
}

// the parameter in which the state of *p differs most from the fit, beside its prior
static size_t most_changed(const fit_problem *p, const own_fit *own)
{
    double most = -1;
    size_t param = 0;
    for (size_t k = 0; k < p->n_params; k++) {
        const double change =
            fabs(p->state.params[k] - own->state.params[k]) / sdm_fit_prior_sd(p, k);
        if (!fit_param_is_kept(p, k) && change > most) most = change, param = k;
    }
    return param;
}

// value: the rival began with another value of a parameter
static void nearest_take(nearest *least, const fit_problem *p, const own_fit *own,
                         const fit_standing *fit, const fit_standing *rival, bool value)
{
    const double gain = sdm_fit_gain(fit, rival);
    if (least->gain <= gain || isnan(gain)) return;
    // as good along open directions, which the fit tells
    if (fabs(gain) < SDM_FIT_PREFERRED &&
        sdm_fit_differs_openly(p, own->result, &own->state, &p->state, own->centre)) {
        least->open = true;
        return;
    }
    const size_t param = value ? most_changed(p, own) + 1 : 0;
    least->gain = gain;
    least->param = param;
    if (param) least->value = p->state.params[param - 1];
    sdm_rotation_vector(p->state.rotation, least->rotation);
    least->state = p->state;
}

// how far a surface may be from that of the fit and still be the same
static const likeness SAME_SURFACE = {.dice = SAME, .apart = APART};

static bool is_other(likeness l) { return l.dice <= SAME || l.apart > APART; }

// whether the rival, which explains the samples with this gain of the fit over it, is clearly
// better
static bool is_better(const fit_standing *fit, const fit_standing *rival)
{
    return (!sdm_fit_has_units(fit, rival) ||
            sdm_fit_chi_square(fit, rival) >= BETTER * sdm_fit_chi_square(rival, fit)) &&
           sdm_fit_gain(fit, rival) < -SDM_FIT_PREFERRED;
}

// whether the fitted shape has another surface in this pose, a large turn away: the parameters of a
// rival may differ because the data do not determine them
static bool is_other_pose(const own_fit *own, const fit_state *state)
{
    return sdm_fit_angle_between(own->state.rotation, state->rotation) >= SYMMETRIC_MIN &&
           is_other(compare(own, own->distance, own->volume, state));
}

// Points: adds to list[*n] the best turns of the fit to other surfaces, as many as `most`, with the
// parameters that sdm_fit_turned_starts() makes of its own
static sdm_status turned_add(fit_problem *p, const own_fit *own, int params, size_t most,
                             fit_start *list, size_t *n, sdm_error *err)
{
    fit_start found[TURNED_MOST];
    size_t n_found = 0, taken = 0;
    p->state = own->state;
    const sdm_status s =
        sdm_fit_turned_starts(p, own->centre, own->axes, params, TURNED_MOST, found, &n_found, err);
    for (size_t i = 0; i < n_found && taken < most && !s; i++)
        if (is_other_pose(own, &found[i].state)) list[(*n)++] = found[i], taken++;
    return s;
}

// the turns from which all unknowns climb: of points those that their poses alone improve, with the
// parameters of the fit and others; else those to nearly the same surface
static sdm_status climbs_list(fit_problem *p, const own_fit *own, const turns *t, fit_start *list,
                              size_t *n, sdm_error *err)
{
    *n = 0;
    if (p->target->kind != SDM_FIT_POINTS) {
        for (; *n < t->n_alike; ++*n) list[*n] = t->alike[*n];
        return SDM_OK;
    }
    sdm_status s = SDM_OK;
    for (int params = 0; params < 3 && !s; params++)
        s = turned_add(p, own, params, params ? TURNED_TRIED_OTHERWISE : TURNED_TRIED, list, n,
                       err);
    p->state = own->state;
    return s ? s : sdm_fit_samples_near(p, SAMPLES, err);
}

// Lowers *least where the fit, turned, climbs to a better maximum: then the fit is not the best
// one. A maximum as good is the same or a symmetric one, unless points do not show where it
// differs. The fit climbs as far on these samples.
static sdm_status compare_climbs(fit_problem *p, own_fit *own, const turns *t, nearest *least,
                                 sdm_error *err)
{
    const bool points = p->target->kind == SDM_FIT_POINTS;
    fit_start list[CLIMBS_MAX];
    fit_standing fit, rival;
    size_t n = 0;
    bool other;
    if (p->opts->keep_params) return SDM_OK;
    sdm_status s = climbs_list(p, own, t, list, &n, err);
    if (s || !n) return s;
    const fit_start here = {.state = own->state};
    s = challenge(p, own, &here, SAME_SURFACE, &other, &fit, err);
    for (size_t i = 0; i < n && !s; i++) {
        tell_rival(p, own);
        s = challenge(p, own, &list[i], SAME_SURFACE, &other, &rival, err);
        if (s || !other) continue;
        const bool worse = points && sdm_fit_gain(&fit, &rival) > -SDM_FIT_PREFERRED;
        if (worse ? is_other_pose(own, &p->state) : is_better(&fit, &rival))
            nearest_take(least, p, own, &fit, &rival, false);
    }
    return s;
}

// the largest symmetry of the surface that is not a rotation by any angle, which is told elsewhere
static void tell_symmetry(const turns *t, nearest *least)
{
    const double *v = t->same.rotation, angle = v3_norm(v);
    if (!(t->same.dice > 0)) return;
    snprintf(
        least->symmetry, sizeof least->symmetry,
        "no pose with another surface is as good; the shape is symmetric: turned by %.0f degrees "
        "about (%.2g, %.2g, %.2g) (LPS) it is the same, and either rotation is right",
        angle * 57.29577951308232, v[0] / angle + 0, v[1] / angle + 0, v[2] / angle + 0);
}

// the least gain over the runner-up of the search, over the best turn, and over the best values
static sdm_status least_gain(fit_problem *p, own_fit *own, nearest *least, sdm_error *err)
{
    // a start that ends near the fit, if not in it, is no rival
    const likeness alike = {.dice = ALIKE, .apart = INFINITY};
    turns *t = NULL;
    fit_start *value = NULL;
    fit_standing rival;
    bool other;
    size_t n_values = 0;
    sdm_status s = SDM_ALLOC(&t, 1, "rival of the fit", err);
    if (!s) s = SDM_ALLOC(&value, PARAMS_TRIED, "rival of the fit", err);
    if (!s) turns_rank(own, t);
    // the tissues of the fit on these samples, as those of its rivals
    if (!s) s = climb(p, true, STEPS_OF_FIT, err);
    if (!s) s = sdm_fit_stand(p, own->factor, &own->standing, err);
    if (!s) s = SDM_ALLOC(&own->field, p->samples.n, "rival of the fit", err);
    if (!s) memcpy(own->field, p->samples.field, p->samples.n * sizeof *own->field);
    const fit_standing *fit = &own->standing;
    if (!s) s = values_rank(p, own, value, &n_values, err);
    if (!s) tell_symmetry(t, least);
    if (!s && p->has_runner_up) {
        const fit_start from = {.state = p->runner_up};
        tell_rival(p, own);
        s = challenge(p, own, &from, alike, &other, &rival, err);
        if (!s && other) nearest_take(least, p, own, fit, &rival, false);
    }
    other = false;
    for (size_t i = 0; !s && i < t->n_other && i < TRIES_MAX && !other; i++) {
        tell_rival(p, own);
        s = challenge(p, own, &t->other[i], alike, &other, &rival, err);
        if (!s && other) nearest_take(least, p, own, fit, &rival, false);
    }
    for (size_t i = 0; i < n_values && !s; i++) {
        tell_rival(p, own);
        s = challenge(p, own, &value[i], alike, &other, &rival, err);
        if (!s && other) nearest_take(least, p, own, fit, &rival, true);
    }
    if (!s) s = compare_climbs(p, own, t, least, err);
    sdm_free(t);
    sdm_free(value);
    return s;
}

// to a thousandth, and without the sign of -0
static double rounded(double radians) { return round(1000 * radians) / 1000 + 0.0; }

void sdm_fit_next_pose_tried(sdm_fit_verdict *v)
{
    const char *const advice[] = {FROM_VALUE, FROM_POSE};
    for (size_t i = 0; i < v->n_findings; i++)
        for (size_t k = 0; k < 2; k++) {
            sdm_fit_finding *f = &v->findings[i];
            char *at = f->kind == SDM_FIT_CHECK_NEXT_POSE ? strstr(f->text, advice[k]) : NULL;
            if (at) snprintf(at, sizeof f->text - (size_t)(at - f->text), "%s", TRIED);
        }
}

sdm_status sdm_fit_judge_next_pose(fit_problem *p, double factor, sdm_fit_result *result,
                                   sdm_error *err)
{
    sdm_fit_verdict *v = &result->verdict;
    const sdm_fit_opts *given = p->opts;
    sdm_fit_opts quiet = *given;
    own_fit own = {0};
    nearest least = {.gain = NAN};
    if (given->keep_pose || v->grade == SDM_FIT_FAILED) return SDM_OK;
    quiet.progress = NULL;
    p->opts = &quiet;
    p->use_tissue_field = false;
    sdm_status s = sdm_fit_samples_near(p, SAMPLES, err);
    if (!s) s = sdm_fit_maps_voxels(&p->maps, err);
    if (!s) s = own_create(p, &own, err);
    own.result = result;
    own.told = given;
    own.all = p->n_params + p->has_runner_up + TRIES_MAX + PARAMS_TRIED + CLIMBS_MAX;
    // of every `stride`-th voxel fewer count as one; where the shape does not explain the image,
    // the likelihood is less certain (Wedderburn 1974)
    own.factor = fmax(factor / pow((double)p->stride, 3), 1) * fmax(v->chi_square, 1);
    if (p->target->kind == SDM_FIT_POINTS) own.factor = fmax(p->noise_factor, 1);
    if (!s) s = least_gain(p, &own, &least, err);
    sdm_free(own.distance);
    sdm_free(own.field);
    p->opts = given;
    if (s) return s;
    if (p->n_motions > 0) least.symmetry[0] = 0; // any angle, which the fit tells
    const bool alone = isnan(least.gain), points = p->target->kind == SDM_FIT_POINTS;
    if (alone || least.gain > SDM_FIT_PREFERRED) {
        sdm_fit_finding passed = {.kind = SDM_FIT_CHECK_NEXT_POSE,
                                  .figure = least.gain,
                                  .limit = alone ? NAN : SDM_FIT_PREFERRED};
        snprintf(passed.text, sizeof passed.text, "%s",
                 *least.symmetry ? least.symmetry
                 : least.open    ? "other poses that explain the data as well differ only along "
                                   "what the fit calls not determined"
                 : alone         ? "every other start, rotation and value of one parameter leads "
                                   "back to this surface"
                                 : "");
        sdm_fit_verdict_add(v, &passed);
        return SDM_OK;
    }
    const char *name = NULL;
    double low, high;
    const double *r = least.rotation;
    char where[100], text[360];
    snprintf(where, sizeof where, "in another pose, rotation (%.3g, %.3g, %.3g) rad,",
             rounded(r[0]), rounded(r[1]), rounded(r[2]));
    if (least.param) sdm_fit_bounds(p->source, least.param - 1, &low, &high, &name);
    if (name)
        snprintf(where, sizeof where, "with another value of %.60s, %.4g,", name, least.value);
    // a start from either leads to either
    const bool equal = least.gain > -SDM_FIT_PREFERRED;
    snprintf(text, sizeof text,
             "the shape %s explains the data %s (log-likelihood of the fit less that of the other: "
             "%.2g): %s",
             where, equal ? "as well" : "better", least.gain,
             equal ? "the data do not tell the two apart; keep what is known "
                     "(sdm_fit_opts.kept), or take data that show more of the shape"
             : sdm_fit_began_at(p, &own.state, &least.state, name ? least.param : 0, own.centre)
                 ? TRIED
             : name ? FROM_VALUE
                    : FROM_POSE);
    // errors of coarse maps at sharp edges weigh more in fits to points than a small gain
    const bool doubt = points && least.gain > -CLEARLY_BETTER;
    // a fit to an image takes long, and such an image mostly shows another shape
    p->has_better = points && !equal;
    p->better = least.state;
    sdm_fit_judge_add(v, SDM_FIT_CHECK_NEXT_POSE, false, doubt ? SDM_FIT_DOUBTFUL : SDM_FIT_FAILED,
                      least.gain, SDM_FIT_PREFERRED, "%s", text);
    return doubt ? SDM_OK : sdm_fail(err, SDM_E_QUALITY, "%s", text);
}
