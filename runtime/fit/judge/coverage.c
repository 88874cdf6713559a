/* Compares the places of points with those of the fitted surface.

   A robust fit leaves out points that lie far from its surface. Strays are scattered; points of
   another surface are neighbours in a thin layer, as dense as those on the shape. And where the
   shape has grown past its data, its surface has no points. Both are found by the distances to the
   nearest points, with those among the points on the shape as the measure. */
#include "coverage.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "finding.h"
#include "fit/data/source_params.h"
#include "fit/data/surface_places.h"
#include "fit/points/pick.h"
#include "fit/solver/prior.h"
#include "noise.h"
#include "outlying.h"
#include "sdm/internal/hardly_known.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/vec3.h"

// points and places of the surface that are compared; of more, every second, third ... one
#define MOST 2000
// neighbours that define the spacing of points, and that show whether points form a layer
#define FEW 4
#define MANY 10
// a stray belongs to a patch if its neighbours are as near as those on the shape, up to this
// multiple of the spacing: a thin tube is no layer at this spacing; or if they are nearer than
// DENSE times the spacing (and not the same point) and the product of the variances along the axes
// of their ellipsoid is this small beside that of a ball: points in a box stay below in a few per
// cent of the cases
#define ALIKE 1.5
#define DENSE 3.0
#define SAME 0.05
#define FLAT 0.15
// a place of the surface has no points if none on its side of a wall is nearer than this multiple
// of the spacing there: with points drawn evenly, 6 are expected nearer, and there is none at 2 of
// 1000 places
#define REACH 1.25
// normals with at most this scalar product are of the two sides of a wall
#define OPPOSITE (-0.5)
// step of the differences for normals, in voxels
#define NORMAL_STEP 0.25
// shares that pass. A surface that is not covered shows a part of the shape, or the shape has grown
// past its data: so it is with a small patch, or with many strays
#define PATCH_DOUBTFUL 0.003
// share of the strays that patches hold by chance
#define BY_CHANCE 0.05
#define PATCH_MAX 0.05
#define PATCH_MAX_UNCOVERED 0.01
#define UNCOVERED_MAX 0.02
#define STRAYS_MAX_UNCOVERED 0.1
// share of the surface without points from which on parameters at their bounds are no chance
#define MOSTLY_UNCOVERED 0.5
// share of the surface that a parameter moves, weighted by the square of the motion, without points
// from which on this is why the points do not determine the parameter
#define UNSEEN_MIN 0.5
// motion of the surface by one standard deviation of such a parameter, over the standard deviation
// of the points, from which on it is named, too: a single point on the part that it moves fastest
// would tell as much
#define MOTION_HARDLY_KNOWN 3.0
// fastest motion of places well within the points, over that of all places, up to which the points
// lie on nothing that the parameter moves
#define STILL 0.05
// a place lies well within the points if no place without points is nearer than this multiple of
// the distance at which a place has none
#define WITHIN 1.5

typedef struct cloud {
    double (*x)[3];
    double (*normal)[3]; // outward, of the surface nearest to a point; NULL: not known
    size_t n;
} cloud;

/* Squared distances from x to the k nearest points of a cloud, ascending, and their numbers; the
   point number `self` is left out, and so are points on the other side of a wall unless normal is
   NULL. */
static void find_nearest(const cloud *c, const double x[3], const double *normal, size_t self,
                         size_t k, double *d2, size_t *number)
{
    for (size_t i = 0; i < k; i++) d2[i] = INFINITY, number[i] = SIZE_MAX;
    for (size_t i = 0; i < c->n; i++) {
        const bool left_out = i == self || (normal && v3_dot(normal, c->normal[i]) <= OPPOSITE);
        const double d = left_out ? INFINITY : v3_dist2(x, c->x[i]);
        size_t at = k;
        for (; at > 0 && d < d2[at - 1]; at--)
            if (at < k) d2[at] = d2[at - 1], number[at] = number[at - 1];
        if (at < k) d2[at] = d, number[at] = i;
    }
}

/* Median distance of the points of a cloud from their FEW-th nearest one; one_side: from the FEW-th
   nearest one on their side of a wall. */
static sdm_status find_spacing(const cloud *c, bool one_side, double *spacing, sdm_error *err)
{
    double *list = NULL, d2[FEW];
    size_t number[FEW];
    const sdm_status s = SDM_ALLOC(&list, c->n, "points of the fit", err);
    for (size_t i = 0; i < c->n && !s; i++) {
        find_nearest(c, c->x[i], one_side ? c->normal[i] : NULL, i, FEW, d2, number);
        list[i] = sqrt(d2[FEW - 1]);
    }
    *spacing = s ? 0 : sdm_fit_median(list, c->n);
    sdm_free(list);
    return s;
}

/* 27 det / trace^3 of the covariance of points: 1 for a ball, 0 for a plane or a line. */
static double roundness(const cloud *c, const size_t *number, size_t n)
{
    double mean[3] = {0}, covariance[9] = {0}, adjugate[9];
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) mean[a] += c->x[number[i]][a] / (double)n;
    for (size_t i = 0; i < n; i++) {
        double r[3];
        for (int a = 0; a < 3; a++) r[a] = c->x[number[i]][a] - mean[a];
        for (int k = 0; k < 9; k++) covariance[k] += r[k / 3] * r[k % 3];
    }
    const double trace = covariance[0] + covariance[4] + covariance[8],
                 det = m3_adjugate(covariance, adjugate);
    return trace > 0 ? 27 * det / (trace * trace * trace) : 1;
}

/* The strays that form patches. */
typedef struct patches {
    size_t n;
    double world[3]; // mean of the stray with the densest neighbourhood and its neighbours
} patches;

static patches find_patches(const cloud *strays, double spacing)
{
    patches found = {0};
    double densest = INFINITY;
    for (size_t i = 0; i < strays->n && strays->n > MANY; i++) {
        double d2[MANY];
        size_t number[MANY + 1];
        find_nearest(strays, strays->x[i], NULL, i, MANY, d2, number);
        number[MANY] = i;
        const double few = sqrt(d2[FEW - 1]);
        if (!(few > SAME * spacing &&
              (few < ALIKE * spacing ||
               (few < DENSE * spacing && roundness(strays, number, MANY + 1) < FLAT))))
            continue;
        found.n++;
        if (!(d2[MANY - 1] < densest)) continue;
        densest = d2[MANY - 1];
        for (int a = 0; a < 3; a++) {
            found.world[a] = 0;
            for (size_t k = 0; k <= MANY; k++)
                found.world[a] += strays->x[number[k]][a] / (MANY + 1);
        }
    }
    return found;
}

/* Adds the check `patch`: the share of the points that lie away from the shape and form another
 * surface. stray: share of all points away from it; bare: share of its surface without points. */
static void judge_patches(const fit_problem *p, const patches *found, size_t n_points, double stray,
                          double bare, sdm_fit_verdict *v)
{
    const double share = (double)found->n / (double)n_points,
                 most = fmax(p->opts->tolerance, PATCH_MAX),
                 refused = bare > UNCOVERED_MAX ? fmin(PATCH_MAX_UNCOVERED, most) : most,
                 limit = fmax(fmax(p->opts->tolerance, PATCH_DOUBTFUL), BY_CHANCE * stray),
                 *x = found->world, d = sdm_fit_maps_at(&p->maps, &p->state, x);
    char place[FIT_PLACE_NAME];
    sdm_fit_judge_add(v, SDM_FIT_CHECK_PATCH, share <= fmin(limit, refused),
                      share > refused ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL, share,
                      fmin(limit, refused),
                      "%.2g %% of the points form a surface that the fitted shape does not "
                      "have, densest at %s, %.2g mm %s of its surface: another shape, or a fit "
                      "that stopped at a wrong one; give a better start, or take other things out "
                      "of the data (sdm_fit_opts.tolerance allows more); failed above %.3g",
                      100 * share, sdm_fit_name_place(&p->state, x, place), fabs(d),
                      d < 0 ? "inside" : "outside", refused);
}

/* Outward normal of the surface that is nearest to x, by differences of the signed distance. */
static void find_normal(const fit_problem *p, const double x[3], double normal[3])
{
    const double step = NORMAL_STEP * fit_longest_edge(&p->maps.grid);
    for (int a = 0; a < 3; a++) {
        double below[3], above[3];
        for (int b = 0; b < 3; b++) below[b] = above[b] = x[b];
        below[a] -= step, above[a] += step;
        normal[a] = sdm_fit_maps_at(&p->maps, &p->state, above) -
                    sdm_fit_maps_at(&p->maps, &p->state, below);
    }
    const double length = v3_norm(normal);
    for (int a = 0; a < 3; a++) normal[a] = length > 0 ? normal[a] / length : 0;
}

/* Splits points into those on the surface, with their normals, and strays, at most MOST in all. */
static void split_points(const fit_problem *p, cloud *on, cloud *strays)
{
    const size_t step = (p->samples.n + MOST - 1) / MOST;
    for (size_t k = 0; k * step < p->samples.n; k++) {
        const size_t i = fit_pick(step, k);
        if (i >= p->samples.n) break;
        cloud *c = sdm_fit_point_belongs(&p->observation, p->samples.field[i]) < 0.5 ? strays : on;
        for (size_t a = 0; a < 3; a++) c->x[c->n][a] = p->samples.world[3 * i + a];
        if (c == on) find_normal(p, c->x[c->n], c->normal[c->n]);
        c->n++;
    }
}

/* bare[i]: place i of the surface has no points within reach on its side of a wall. Strays count:
   they may lie on the surface of another shape that touches this one. Returns the share of such
   places. */
static double find_bare(const fit_problem *p, const fit_places *surface, const cloud *on,
                        const cloud *strays, double reach, bool *bare)
{
    size_t n = 0, number;
    for (size_t i = 0; i < surface->n; i++) {
        const double *x = surface->world[i];
        double normal[3], d2[2];
        find_normal(p, x, normal);
        find_nearest(on, x, normal, SIZE_MAX, 1, &d2[0], &number);
        find_nearest(strays, x, NULL, SIZE_MAX, 1, &d2[1], &number);
        bare[i] = fmin(d2[0], d2[1]) > reach * reach;
        n += bare[i];
    }
    return surface->n ? (double)n / (double)surface->n : 0;
}

/* The part of the surface without points: of its places, the one nearest to their mean. NULL: all
 * of the surface has points. */
static const double *middle_of_bare(const fit_places *surface, const bool *bare)
{
    double mean[3] = {0}, nearest = INFINITY;
    const double *middle = NULL;
    size_t n = 0;
    for (size_t i = 0; i < surface->n; i++) {
        for (int a = 0; a < 3 && bare[i]; a++) mean[a] += surface->world[i][a];
        n += bare[i];
    }
    for (int a = 0; a < 3 && n; a++) mean[a] /= (double)n;
    for (size_t i = 0; i < surface->n; i++) {
        const double d2 = v3_dist2(surface->world[i], mean);
        if (bare[i] && d2 < nearest) nearest = d2, middle = surface->world[i];
    }
    return middle;
}

/* within[i]: place i of the surface has points, and so have the places near it. */
static sdm_status find_within(const fit_places *surface, const bool *bare, double reach,
                              bool *within, sdm_error *err)
{
    cloud without = {0};
    const sdm_status s = SDM_ALLOC(&without.x, surface->n + 1, "places of the surface", err);
    if (s) return s;
    for (size_t i = 0; i < surface->n; i++)
        if (bare[i]) memcpy(without.x[without.n++], surface->world[i], sizeof *without.x);
    for (size_t i = 0; i < surface->n; i++) {
        double d2;
        size_t number;
        find_nearest(&without, surface->world[i], NULL, SIZE_MAX, 1, &d2, &number);
        within[i] = d2 > WITHIN * WITHIN * reach * reach;
    }
    sdm_free(without.x);
    return SDM_OK;
}

/* The parameters that the points hardly determine and that move a surface which has no points. */
typedef struct unseen {
    char names[SDM_FIT_NAMES_MAX];
    double most;  // largest share of such a surface without points; 0: there is no such parameter
    bool touched; // one of them moves places well within the points, too
    bool narrow;  // all have a standard deviation far below that before the fit
} unseen;

static unseen find_unseen(const fit_problem *p, const sdm_fit_result *r, const fit_places *surface,
                          const bool *bare, const bool *within)
{
    const double edge = fit_longest_edge(&p->maps.grid);
    unseen found = {.narrow = true};
    for (size_t k = 0; k < p->n_params; k++) {
        double all = 0, without = 0, fastest = 0, inner = 0, low, high;
        const double sd = sdm_fit_prior_sd(p, k);
        const char *name = "";
        if (fit_param_is_kept(p, k)) continue;
        for (size_t i = 0; i < surface->n; i++) {
            const double by = surface->by[i * p->n_params + k];
            all += by * by;
            without += bare[i] ? by * by : 0;
            fastest = fmax(fastest, fabs(by));
            if (within[i]) inner = fmax(inner, fabs(by));
        }
        const bool wide = r->sd[k] > SDM_FIT_HARDLY_KNOWN * sd, touched = inner > STILL * fastest,
                   vague = !touched && r->sd[k] * fastest > MOTION_HARDLY_KNOWN * p->state.point_sd;
        if (!(fastest * sd > edge) || !(without > UNSEEN_MIN * all) || !(wide || vague)) continue;
        found.most = fmax(found.most, without / all);
        found.touched = found.touched || touched;
        found.narrow = found.narrow && !wide;
        sdm_fit_bounds(p->source, k, &low, &high, &name);
        const size_t used = strlen(found.names);
        snprintf(found.names + used, sizeof found.names - used, "%s%.40s", used ? ", " : "", name);
    }
    return found;
}

/* text[size] = which parameters these are, and what helps. Another start may help where the fit
   stopped at a wrong value of which it is sure. */
static void describe_unseen(const unseen *x, char *text, size_t size)
{
    const char *move = strchr(x->names, ',') ? "they move" : "it moves";
    char why[100];
    if (x->touched)
        snprintf(why, sizeof why, "most of the part of the fitted surface that %s has no points",
                 move);
    else
        snprintf(why, sizeof why, "no points lie near the part of the fitted surface that %s",
                 move);
    snprintf(text, size,
             "the data hardly determine %s: %s; keep a known value (sdm_fit_opts.start_params, "
             "sdm_fit_opts.kept), or take points from there%s",
             x->names, why,
             x->narrow ? "; the fit may have stopped at a wrong value: start from another one"
                       : "");
}

/* Share of the parameters that end at a bound. */
static double share_at_bounds(const fit_problem *p)
{
    size_t at = 0;
    for (size_t k = 0; k < p->n_params; k++)
        at += !fit_param_is_kept(p, k) &&
              !(p->state.params[k] > p->low[k] && p->state.params[k] < p->high[k]);
    return p->n_params ? (double)at / (double)p->n_params : 0;
}

sdm_status sdm_fit_check_coverage(const fit_problem *p, const sdm_fit_result *r,
                                  fit_coarseness coarse, sdm_fit_verdict *v, sdm_error *err)
{
    cloud on = {0}, strays = {0};
    fit_places surface = {0};
    bool *bare_at = NULL, *within = NULL;
    double spacing = 0, reach = 0;
    sdm_status s = SDM_ALLOC(&on.x, MOST + 1, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&on.normal, MOST + 1, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&strays.x, MOST + 1, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&bare_at, MOST + 1, "places of the surface", err);
    if (!s) s = SDM_ALLOC(&within, MOST + 1, "places of the surface", err);
    if (!s) split_points(p, &on, &strays);
    if (!s && on.n > MANY) s = find_spacing(&on, false, &spacing, err);
    if (!s && on.n > MANY) s = find_spacing(&on, true, &reach, err);
    reach = REACH * reach + 3 * p->state.point_sd;
    if (!s && on.n > MANY) s = sdm_fit_places_create(&p->maps, &p->state, MOST, &surface, err);
    if (!s && spacing > 0) {
        const patches found = find_patches(&strays, spacing);
        const double bare = find_bare(p, &surface, &on, &strays, reach, bare_at),
                     stray = (double)strays.n / (double)(on.n + strays.n);
        const bool other = bare > MOSTLY_UNCOVERED && share_at_bounds(p) >= 0.5;
        const bool grown = stray > fmax(p->opts->tolerance, STRAYS_MAX_UNCOVERED);
        judge_patches(p, &found, on.n + strays.n, stray, bare, v);
        char unseen_text[512] = "", astray[80] = "", beside[90] = "";
        const double voxel = fit_longest_edge(&p->maps.grid);
        char place[FIT_PLACE_NAME] = "";
        const double *middle = grown || other ? NULL : middle_of_bare(&surface, bare_at);
        if (middle) sdm_fit_name_place(&p->state, middle, place);
        if (stray >= 0.005)
            snprintf(astray, sizeof astray, ", and %.0f %% of the points lie away from the surface",
                     100 * stray);
        if (voxel > coarse.limit)
            snprintf(beside, sizeof beside,
                     "; or the voxels of the maps, %.2g mm, are too coarse to show its surface",
                     voxel);
        s = find_within(&surface, bare_at, reach, within, err);
        const unseen hidden = s ? (unseen){0} : find_unseen(p, r, &surface, bare_at, within);
        if (hidden.most > 0) describe_unseen(&hidden, unseen_text, sizeof unseen_text);
        const bool covered = bare <= UNCOVERED_MAX;
        if (covered && hidden.most > 0)
            sdm_fit_judge_add(v, SDM_FIT_CHECK_COVERED, false, SDM_FIT_DOUBTFUL, hidden.most,
                              UNSEEN_MIN, "%s", unseen_text);
        else
            sdm_fit_judge_add(
                v, SDM_FIT_CHECK_COVERED, covered,
                grown || other ? SDM_FIT_FAILED : SDM_FIT_DOUBTFUL, bare, UNCOVERED_MAX,
                "%.0f %% of the fitted surface has no points near it%s%s%s: %s%s%s%s", 100 * bare,
                middle ? ", about " : "", place, astray,
                grown   ? "a fit that stopped at a wrong shape; give a better start, or take the "
                          "strays out (sdm_fit_opts.tolerance allows more)"
                : other ? "most of it, and half of the parameters or more end at their bounds: the "
                          "data show another shape, or their lengths are in another unit"
                : hidden.most > 0 ? ""
                                  : "the data lack a part of the shape, or the shape is too large",
                (grown || other) && hidden.most > 0 ? "; " : "", unseen_text, beside);
    }
    sdm_free(bare_at);
    sdm_free(within);
    sdm_free(on.x);
    sdm_free(on.normal);
    sdm_free(strays.x);
    sdm_fit_places_dispose(&surface);
    return s;
}
