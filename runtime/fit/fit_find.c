/* The search of a whole image for shapes: sdm_fit_find(), the last function, lists its steps. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fit/data/map_fields.h"
#include "fit/start/coarse_scan.h"
#include "fit/start/turn_set.h"
#include "fit/start/turned_pattern.h"
#include "fit_check.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

// edge of the finest boxes in inradii, and its limits in reaches; the boxes of the middle level are
// twice as large, those of the coarse level four times
#define EDGE 0.4
#define EDGE_LEAST 0.025
#define EDGE_MOST 0.0833
// number of rotations: with coarse boxes at every place, with middle ones at the best places
enum { COARSE_TURNS = 48, MIDDLE_TURNS = 400 };
// number of places that are tried with middle boxes; that climb with fine ones and few points of
// the pattern, from one rotation and from several; that climb with all points, for every candidate
// that is wanted
enum { PLACES = 8000, FINE_PLACES = 1500, FINE_TURN_PLACES = 200, FULL_PLACES = 4 };
// number of rotations of a place that climb, and their least angle, rad
enum { CLIMBS = 3 };
#define CLIMB_APART 0.5
// every so many points of a pattern count
enum { STRIDE_SPARSE = 7, STRIDE_MEDIUM = 3 };
// least score of a candidate
#define SCORE_LEAST 0.15f

// a place with its score
typedef struct found {
    fit_place place;
    size_t source;
    double score;
    // index of its rotations in the list of those of all places
    size_t first;
} found;

typedef struct search {
    const sdm_fit_target *target;
    const fit_pattern *patterns;
    size_t n_patterns;
    int n_threads;
    fit_likeness coarse, middle, fine;
    // [n] the places, the best first
    found *list;
    size_t n;
} search;

// the best first; equal ones in the order of their places
static int better(const void *a, const void *b)
{
    const found *x = a, *y = b;
    if (x->score != y->score) return x->score < y->score ? 1 : -1;
    for (int k = 2; k >= 0; k--)
        if (x->place.at[k] != y->place.at[k]) return x->place.at[k] < y->place.at[k] ? -1 : 1;
    return 0;
}

// ---- with coarse boxes ----

// whether a box has the largest score of the 27 about it; of equal ones the first
static bool is_peak(const fit_likeness *l, const float *best, int64_t at)
{
    for (int64_t k = -1; k <= 1; k++)
        for (int64_t j = -1; j <= 1; j++)
            for (int64_t i = -1; i <= 1; i++) {
                const int64_t step = (k * l->n[1] + j) * l->n[0] + i;
                if (best[at + step] > best[at] || (best[at + step] == best[at] && step < 0))
                    return false;
            }
    return true;
}

static bool in_box(const sdm_fit_target *t, const sdm_fit_opts *o, const double u[3])
{
    double world[3];
    if (!o->use_box) return true;
    m3_apply(t->grid.dir, u, world);
    for (int a = 0; a < 3; a++) {
        world[a] += t->grid.origin[a];
        if (world[a] < o->box_min[a] || world[a] > o->box_max[a]) return false;
    }
    return true;
}

// s->list = the peaks of the scores of the coarse boxes
static sdm_status peaks_take(search *s, const sdm_fit_opts *o, const float *best, sdm_error *err)
{
    const fit_likeness *l = &s->coarse;
    size_t n = 0;
    for (int pass = 0; pass < 2; pass++) {
        s->n = 0;
        for (int64_t k = l->pad[2]; k < l->n[2] - l->pad[2]; k++)
            for (int64_t j = l->pad[1]; j < l->n[1] - l->pad[1]; j++)
                for (int64_t i = l->pad[0]; i < l->n[0] - l->pad[0]; i++) {
                    const int64_t at = (k * l->n[1] + j) * l->n[0] + i;
                    double u[3];
                    if (best[at] < SCORE_LEAST || !is_peak(l, best, at)) continue;
                    sdm_fit_likeness_point(l, &s->target->grid,
                                           (const double[3]){(double)i, (double)j, (double)k}, u);
                    if (!in_box(s->target, o, u)) continue;
                    if (pass) {
                        s->list[s->n] = (found){.score = (double)best[at], .place.size = 1};
                        memcpy(s->list[s->n].place.at, u, sizeof u);
                    }
                    s->n++;
                }
        n = s->n;
        if (pass) break;
        const sdm_status status = SDM_ALLOC(&s->list, n + 1, "places of the search", err);
        if (status) return status;
    }
    qsort(s->list, n, sizeof *s->list, better);
    return SDM_OK;
}

static sdm_status coarse_search(search *s, const sdm_fit_opts *o, sdm_error *err)
{
    float *best = NULL;
    const fit_likeness *l = &s->coarse;
    sdm_status status =
        SDM_ALLOC(&best, (size_t)(l->n[0] * l->n[1] * l->n[2]), "scores of the search", err);
    if (!status)
        status = sdm_fit_coarse_scan(s->patterns, s->n_patterns, COARSE_TURNS, l, SCORE_LEAST,
                                     s->n_threads, best, err);
    if (!status) status = peaks_take(s, o, best, err);
    sdm_free(best);
    return status;
}

// ---- with middle and fine boxes ----

// inserts a rotation into best[CLIMBS] if it is among the best, of near ones the best alone
static void turns_keep(found *best, const found *x)
{
    int at = 0;
    while (at < CLIMBS &&
           (best[at].source != x->source || best[at].score <= -1 ||
            sdm_fit_angle_between(best[at].place.rotation, x->place.rotation) > CLIMB_APART))
        at++;
    if (at == CLIMBS) at--; // a new one replaces the last
    if (x->score <= best[at].score) return;
    for (; at > 0 && best[at - 1].score < x->score; at--) best[at] = best[at - 1];
    best[at] = *x;
}

// best[CLIMBS] = the best rotations at the place of *x
static void place_turn(const search *s, const fit_turned *turned, const found *x, found *best)
{
    const fit_likeness *l = &s->middle;
    double index[3];
    sdm_fit_likeness_index(l, &s->target->grid, x->place.at, index);
    const uint8_t *at =
        l->values + (llrint(index[2]) * l->n[1] + llrint(index[1])) * l->n[0] + llrint(index[0]);
    for (int i = 0; i < CLIMBS; i++) best[i] = (found){.score = -1};
    for (found y = *x; y.source < s->n_patterns; y.source++)
        for (size_t r = 0; r < MIDDLE_TURNS; r++) {
            y.score = sdm_fit_turned_score(&turned[y.source], r, at);
            if (y.score <= best[CLIMBS - 1].score) continue;
            sdm_fit_turn(SDM_FIT_TURNS_SPHERE, r, MIDDLE_TURNS, y.place.rotation);
            turns_keep(best, &y);
        }
}

// climbs from the first rotations of a place, best[n]; *x = the best
static void place_climb(const search *s, const fit_likeness *l, size_t stride, size_t n,
                        found *best, found *x)
{
    const size_t first = x->first;
    x->score = -1;
    for (size_t i = 0; i < n; i++) {
        if (best[i].score <= -1) continue;
        best[i].score = sdm_fit_pattern_climb(&s->patterns[best[i].source], l, &s->target->grid,
                                              stride, &best[i].place);
        if (best[i].score > x->score) *x = best[i];
    }
    qsort(best, n, sizeof *best, better);
    x->first = first;
}

// climbs from n rotations of the best `most` places, which alone stay
static void places_climb(search *s, size_t most, const fit_likeness *l, size_t stride, size_t n,
                         found *best)
{
    if (s->n > most) s->n = most;
#pragma omp parallel for schedule(dynamic) num_threads(s->n_threads)
    for (size_t i = 0; i < s->n; i++)
        place_climb(s, l, stride, n, best + s->list[i].first, &s->list[i]);
    qsort(s->list, s->n, sizeof *s->list, better);
}

// tries all rotations at the places, and climbs from the best ones, with smaller and smaller boxes
static sdm_status places_turn(search *s, size_t most, sdm_error *err)
{
    fit_turned *turned = NULL;
    found *best = NULL;
    size_t made = 0;
    if (s->n > PLACES) s->n = PLACES;
    sdm_status status = SDM_ALLOC(&turned, s->n_patterns, "rotated patterns", err);
    if (!status) status = SDM_ALLOC(&best, s->n * CLIMBS + 1, "rotations of places", err);
    for (; made < s->n_patterns && !status; made++)
        status = sdm_fit_turned_make(&s->patterns[made], &s->middle, MIDDLE_TURNS, STRIDE_SPARSE,
                                     &turned[made], err);
    if (!status) {
#pragma omp parallel for schedule(dynamic) num_threads(s->n_threads)
        for (size_t i = 0; i < s->n; i++) {
            place_turn(s, turned, &s->list[i], best + i * CLIMBS);
            s->list[i].first = i * CLIMBS;
        }
        places_climb(s, PLACES, &s->middle, STRIDE_SPARSE, CLIMBS, best);
        places_climb(s, FINE_PLACES, &s->fine, STRIDE_MEDIUM, 1, best);
        places_climb(s, FINE_TURN_PLACES, &s->fine, STRIDE_MEDIUM, CLIMBS, best);
        places_climb(s, FULL_PLACES * most, &s->fine, 1, CLIMBS, best);
    }
    for (size_t i = 0; i < made; i++) sdm_fit_turned_dispose(&turned[i]);
    sdm_free(turned);
    sdm_free(best);
    return status;
}

// removes places that are near a better one
static void places_thin(search *s)
{
    size_t n = 0;
    for (size_t i = 0; i < s->n; i++) {
        bool near = s->list[i].score < SCORE_LEAST;
        for (size_t j = 0; j < n && !near; j++)
            near = v3_dist2(s->list[i].place.at, s->list[j].place.at) <
                   0.25 * s->patterns[0].reach * s->patterns[0].reach;
        if (!near) s->list[n++] = s->list[i];
    }
    s->n = n;
}

// ---- from beginning to end ----

// the pose of a shape in the world
static void candidate_write(const search *s, const found *x, sdm_fit_candidate *out)
{
    const sdm_grid *g = &s->target->grid;
    double r[9], at[3], moved[3];
    *out = (sdm_fit_candidate){.source = x->source, .score = x->score};
    m3_product(g->dir, x->place.rotation, r);
    sdm_rotation_vector(r, out->pose.rotation);
    m3_apply(g->dir, x->place.at, at);
    m3_apply(r, s->patterns[x->source].centre, moved);
    for (int a = 0; a < 3; a++) out->pose.translation[a] = g->origin[a] + at[a] - moved[a];
}

static sdm_status likeness_make(search *s, const sdm_fit_opts *o, sdm_error *err)
{
    const fit_pattern *p = s->patterns;
    const double margin = p->reach + 2 * p->inradius,
                 edge = fmin(fmax(EDGE * p->inradius, EDGE_LEAST * p->reach), EDGE_MOST * p->reach);
    sdm_status status = sdm_fit_likeness_make(s->target, o, 4 * edge, margin, &s->coarse, err);
    if (!status) status = sdm_fit_likeness_make(s->target, o, 2 * edge, margin, &s->middle, err);
    if (!status) status = sdm_fit_likeness_make(s->target, o, edge, margin, &s->fine, err);
    return status;
}

static sdm_status check_arguments(const sdm_fit_source *sources, size_t n_sources,
                                  const sdm_fit_target *target, const sdm_fit_opts *opts,
                                  size_t most, sdm_error *err)
{
    size_t n, n_first = 0;
    if (!sources || !n_sources || !target || !opts || most < 1 || most > 1000)
        return sdm_fail(err, SDM_E_ARG,
                        "search: sources, a target, options and 1 to 1000 candidates are needed");
    if (target->kind == SDM_FIT_POINTS)
        return sdm_fail(err, SDM_E_ARG, "search: points cannot be searched, only volumes");
    for (size_t i = 0; i < n_sources; i++) {
        const sdm_status s = sdm_fit_check_source(&sources[i], &n, err);
        if (s) return s;
        if (!i) n_first = n;
        if (n != n_first)
            return sdm_fail(err, SDM_E_ARG, "search: the shapes have %zu and %zu parameters",
                            n_first, n);
    }
    return sdm_fit_check(target, opts, err);
}

static sdm_status voxels_check(const search *s, sdm_error *err)
{
    const double voxel = fit_longest_edge(&s->target->grid);
    if (voxel <= s->patterns[0].reach) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "voxels of %.4g mm are larger than the shape, which reaches %.3g mm from its "
                    "middle: is the image in mm?",
                    voxel, s->patterns[0].reach);
}

static sdm_status cancelled(const sdm_fit_opts *o, sdm_error *err)
{
    return o->cancelled && o->cancelled(o->user)
               ? sdm_fail(err, SDM_E_CANCELLED, "search stopped on request")
               : SDM_OK;
}

sdm_status sdm_fit_find(const sdm_fit_source *sources, size_t n_sources,
                        const sdm_fit_target *target, const sdm_fit_opts *opts, size_t most,
                        sdm_fit_candidate *out, size_t *n, sdm_error *err)
{
    if (!out || !n) return sdm_fail(err, SDM_E_ARG, "search: a place for the result is needed");
    *n = 0;
    sdm_status status = check_arguments(sources, n_sources, target, opts, most, err);
    if (status) return status;

    // 1. patterns of the shapes; 2. likeness of the image; 3. places, with coarse boxes; 4. their
    // rotations, with finer ones
    fit_pattern *patterns = NULL;
    search s = {.target = target, .n_threads = sdm_threads(opts->n_threads)};
    status = SDM_ALLOC(&patterns, n_sources, "patterns of the shapes", err);
    for (; s.n_patterns < n_sources && !status; s.n_patterns++)
        status = sdm_fit_pattern_make(&sources[s.n_patterns], opts, &patterns[s.n_patterns], err);
    s.patterns = patterns;
    if (!status) status = voxels_check(&s, err);
    if (!status) status = likeness_make(&s, opts, err);
    if (!status) status = cancelled(opts, err);
    if (!status) status = coarse_search(&s, opts, err);
    if (!status) status = cancelled(opts, err);
    if (!status) status = places_turn(&s, most, err);
    if (!status) {
        places_thin(&s);
        *n = s.n < most ? s.n : most;
        for (size_t i = 0; i < *n; i++) candidate_write(&s, &s.list[i], &out[i]);
    }
    sdm_free(s.list);
    sdm_fit_likeness_dispose(&s.coarse);
    sdm_fit_likeness_dispose(&s.middle);
    sdm_fit_likeness_dispose(&s.fine);
    for (size_t i = 0; i < s.n_patterns; i++) sdm_fit_pattern_dispose(&patterns[i]);
    sdm_free(patterns);
    return status;
}
