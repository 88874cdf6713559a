/* Groups of outlying points.

   `same` of the k nearest points of an outlying one lie off the surface on its side as well. Points
   within r of it have distances from the surface that differ by at most r, and feet within
   |distance| + r. So an outlier at any place, of such a distance, is one of them with at most the
   probability a, the share of the points on the surface that lie within |distance| + r: of `level`
   such outliers, `same` or more are with a probability below exp(-level D(same / level || a))
   (Chernoff 1952). Where the noise is larger, as many lie on the other side of the surface: their
   number, and one more, is the expected one of rare events (Poisson 1837). */
#include "outlying.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "finding.h"
#include "fit/points/pick.h"
#include "fit/trust/posterior.h"
#include "residuals.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"
#include "suffice.h"

// most pairs of an outlying point and any point that are compared; of more points, every second,
// third ... one
#define PAIRS_MAX 2e8
// a point is outlying from this number of standard deviations on
#define OUTLYING_SD 5.0
// smallest standard deviation over the largest radius: facets
#define SD_OVER_RADIUS 0.005
// error of the maps beside edges, in voxels
#define EDGE_ERROR 0.5
// with a larger share of outlying points they form no groups, but show another shape
#define SHARE_MAX 0.35
// numbers of neighbours: K_FIRST, twice as many, and K_LAST; at most an eighth of the points
#define K_FIRST 12
#define K_LAST 48
#define SCALES 3
#define K_OVER_POINTS 0.125
// terms of a sum that are smaller beside it do not count
#define TERM_MIN 1e-9
// chance that outliers at any places form a group
#define BY_CHANCE 1e-3
// chance that larger noise, which has outliers on both sides, puts so many of the neighbours of an
// outlier on its side
#define BY_NOISE 1e-4
// the neighbours on the other side lie within this multiple of the distance of those on its side:
// the surface may be curved
#define MIRROR_REACH 1.5
// smaller groups are strays, and so are those of a smaller share of the points
#define GROUP_MIN 8
#define GROUP_SHARE_MIN 0.0005
// the text names up to so many standard deviations: points without errors have none
#define SD_TOLD_MAX 1000.0

/* An outlying point. */
typedef struct outlier {
    size_t point;
    size_t parent; // another outlier of its group; itself: it stands for the group
    size_t size;   // of the group, if it stands for it
    bool member;
} outlier;

typedef struct outliers {
    size_t n;
    outlier *list;  // [n]
    size_t *number; // [points] 1 + its outlier; 0: it is not outlying
} outliers;

static size_t root_of(outlier *list, size_t i)
{
    while (list[i].parent != i) {
        list[i].parent = list[list[i].parent].parent;
        i = list[i].parent;
    }
    return i;
}

static void unite(outlier *list, size_t i, size_t j)
{
    const size_t a = root_of(list, i), b = root_of(list, j);
    list[a > b ? a : b].parent = a > b ? b : a;
}

/* The nearest k points of a point, those in the same place left out: squared distances, ascending,
 * and numbers. */
static void find_nearest(const fit_distances *t, size_t point, size_t k, double *d2, size_t *number)
{
    for (size_t i = 0; i < k; i++) d2[i] = INFINITY, number[i] = SIZE_MAX;
    for (size_t i = 0; i < t->n; i++) {
        const double d = v3_dist2(t->x[point], t->x[i]);
        if (!(d < d2[k - 1]) || !(d > 0)) continue;
        size_t at = k - 1;
        for (; at > 0 && d < d2[at - 1]; at--) d2[at] = d2[at - 1], number[at] = number[at - 1];
        d2[at] = d, number[at] = i;
    }
}

/* Probability of m or more events where `mean` are expected. */
static double poisson_tail(double mean, size_t m)
{
    if ((double)m <= mean) return 1;
    double term = exp((double)m * log(mean) - mean - lgamma((double)m + 1)), sum = 0;
    for (size_t k = m + 1; term > TERM_MIN * sum; k++) sum += term, term *= mean / (double)k;
    return sum;
}

static bool is_outside(const fit_distances *t, size_t point) { return t->distance[point] > 0; }

/* Bound of the probability of m or more of n events, each with the probability p. */
static double binomial_bound(size_t n, double p, size_t m)
{
    const double share = fmin((double)m / (double)n, 1), rest = 1 - share;
    if (!(share > p)) return 1;
    return exp(-(double)n * (share * log(share / p) + (rest > 0 ? rest * log(rest / (1 - p)) : 0)));
}

/* What lies within `within` mm of an outlying point, or may. */
typedef struct surroundings {
    size_t on;     // points on the surface whose feet may be as near
    size_t level;  // outlying points whose distances from the surface are those of points as near
    size_t mirror; // outlying points about as near to its mirror image on the other side
} surroundings;

static surroundings look_around(const fit_distances *t, const outliers *o, size_t point,
                                double within)
{
    const double d = t->distance[point], reach = fabs(d) + within, wide = MIRROR_REACH * within;
    double least = INFINITY, mirror[3] = {0};
    surroundings found = {0};
    for (size_t i = 0; i < t->n; i++) {
        const double d2 = o->number[i] ? INFINITY : v3_dist2(t->x[point], t->x[i]);
        found.on += d2 < reach * reach;
        if (!(d2 < least)) continue;
        least = d2;
        for (size_t a = 0; a < 3; a++) mirror[a] = 2 * t->x[i][a] - t->x[point][a];
    }
    for (size_t i = 0; i < o->n; i++) {
        const size_t other = o->list[i].point;
        const bool side = is_outside(t, other) == is_outside(t, point);
        found.level += side && other != point && fabs(t->distance[other] - d) <= within;
        found.mirror += !side && v3_dist2(mirror, t->x[other]) <= wide * wide;
    }
    return found;
}

/* Joins outlier i with those of its neighbours that lie off the surface on the same side, if chance
 * does not explain their number. */
static void join(const fit_distances *t, outliers *o, size_t i)
{
    const size_t point = o->list[i].point, on = t->n - o->n;
    const double most = fmin(K_LAST, K_OVER_POINTS * (double)t->n),
                 limit = BY_CHANCE / (SCALES * (double)o->n);
    const bool side = is_outside(t, point);
    double d2[K_LAST];
    size_t nearest[K_LAST], same = 0, other = 0, seen = 0;
    find_nearest(t, point, K_LAST, d2, nearest);
    for (size_t k = K_FIRST; (double)k <= most && d2[k - 1] < INFINITY; k *= 2) {
        for (; seen < k; seen++)
            if (o->number[nearest[seen]])
                ++*(is_outside(t, nearest[seen]) == side ? &same : &other);
        if (poisson_tail((double)(other + 1), same) > BY_NOISE) continue;
        const surroundings x = look_around(t, o, point, sqrt(d2[k - 1]));
        const double around = (double)(x.on > k ? x.on : k) / (double)on;
        if (binomial_bound(x.level, around, same) > limit ||
            poisson_tail((double)(x.mirror + 1), same) > BY_NOISE)
            continue;
        o->list[i].member = true;
        for (size_t j = 0; j < k; j++) {
            const size_t number = o->number[nearest[j]];
            if (!number || is_outside(t, nearest[j]) != side) continue;
            o->list[number - 1].member = true;
            unite(o->list, i, number - 1);
        }
        return;
    }
}

static void measure_largest(const fit_distances *t, outliers *o, size_t root, fit_groups *g)
{
    g->nearest = INFINITY;
    for (size_t i = 0; i < o->n; i++) {
        if (root_of(o->list, i) != root) continue;
        const size_t point = o->list[i].point;
        const double d = t->distance[point], weight = 1 / (double)g->largest;
        for (size_t a = 0; a < 3; a++) g->centre[a] += weight * t->x[point][a];
        g->mean += weight * d;
        g->nearest = fmin(g->nearest, fabs(d)), g->farthest = fmax(g->farthest, fabs(d));
    }
}

static void measure_groups(const fit_distances *t, outliers *o, fit_groups *g)
{
    size_t root = 0;
    for (size_t i = 0; i < o->n; i++)
        if (o->list[i].member) o->list[root_of(o->list, i)].size++;
    for (size_t i = 0; i < o->n; i++) {
        const size_t size = o->list[i].size;
        if (size < g->least) continue;
        g->n += size;
        if (size > g->largest) g->largest = size, root = i;
    }
    if (g->largest) measure_largest(t, o, root, g);
}

sdm_status sdm_fit_groups_find(const fit_distances *t, fit_groups *g, sdm_error *err)
{
    outliers o = {0};
    *g = (fit_groups){.least = GROUP_MIN};
    g->least = (size_t)fmax(GROUP_MIN, ceil(GROUP_SHARE_MIN * (double)t->n));
    sdm_status s = SDM_ALLOC(&o.list, t->n, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&o.number, t->n, "points of the fit", err);
    for (size_t i = 0; i < t->n && !s; i++) {
        if (!(fabs(t->distance[i]) > t->far)) continue;
        o.list[o.n] = (outlier){.point = i, .parent = o.n};
        o.number[i] = ++o.n;
    }
    if (!s && o.n >= g->least && (double)o.n <= SHARE_MAX * (double)t->n) {
        for (size_t i = 0; i < o.n; i++) join(t, &o, i);
        measure_groups(t, &o, g);
    }
    sdm_free(o.list);
    sdm_free(o.number);
    return s;
}

/* Distance beyond which points with the standard deviation sd are outlying, mm. */
static double far_off(const fit_problem *p, double sd)
{
    const double radius = sdm_fit_inradius(&p->maps), facets = SD_OVER_RADIUS * radius;
    if (fit_maps_direct(&p->maps)) return OUTLYING_SD * hypot(sd, facets);
    return OUTLYING_SD * hypot(hypot(sd, facets), sdm_fit_network_error(p)) +
           EDGE_ERROR * fit_longest_edge(&p->maps.grid);
}

/* *t = the points of the fit, or every step-th one; sdm_free() frees its lists, also after an
 * error. */
static sdm_status take_points(const fit_problem *p, double far, fit_distances *t, sdm_error *err)
{
    const size_t all = p->samples.n;
    double n_far = 0;
    for (size_t i = 0; i < all; i++) n_far += fabs(p->samples.field[i]) > far;
    const size_t step = (size_t)ceil(fmax(sqrt(n_far * (double)all / PAIRS_MAX), 1));
    *t = (fit_distances){.far = far};
    sdm_status s = SDM_ALLOC(&t->x, all / step + 1, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&t->distance, all / step + 1, "points of the fit", err);
    for (size_t k = 0; k * step < all && !s; k++) {
        const size_t i = fit_pick(step, k);
        if (i >= all) break;
        for (size_t a = 0; a < 3; a++) t->x[t->n][a] = p->samples.world[3 * i + a];
        t->distance[t->n++] = p->samples.field[i];
    }
    return s;
}

/* More outlying points that lie together than this multiple of the largest group are in several
 * places. */
#define SEVERAL 1.2

static void doubt_patch(const fit_problem *p, const fit_distances *t, const fit_groups *g,
                        double sd, sdm_fit_verdict *v)
{
    const double share = (double)g->n / (double)t->n,
                 limit = fmax(p->opts->tolerance, (double)(g->least - 1) / (double)t->n),
                 many = (double)g->largest * (double)p->samples.n / (double)t->n;
    char place[FIT_PLACE_NAME], sds[60] = "";
    if (share <= limit) return;
    // text and figure agree where there is one group
    const char *several = (double)g->n > SEVERAL * (double)g->largest
                              ? "outlying points lie together in several places; in the largest "
                              : "";
    if (fabs(g->mean) < SD_TOLD_MAX * sd)
        snprintf(sds, sizeof sds, ", on average %.2g standard deviations of the points,",
                 fabs(g->mean) / sd);
    sdm_fit_judge_add(v, SDM_FIT_CHECK_PATCH, false, SDM_FIT_DOUBTFUL, share, limit,
                      "%sabout %.0f points lie together %.2g to %.2g mm %s the fitted surface%s at "
                      "%s: %s; look there, and take them out of the data if they are no part of it "
                      "(sdm_fit_opts.tolerance accepts a difference)",
                      several, many, g->nearest, g->farthest, g->mean < 0 ? "inside" : "outside of",
                      sds, sdm_fit_name_place(&p->state, g->centre, place),
                      g->mean < 0 ? "the data lack a part of the shape, or show a hollow"
                                  : "the data have a part that the shape lacks");
}

sdm_status sdm_fit_check_outlying(const fit_problem *p, sdm_fit_verdict *v, sdm_error *err)
{
    fit_distances t = {0};
    fit_groups groups = {0};
    double sd = 0;
    sdm_status s = sdm_fit_points_sd(p, &sd, err);
    if (p->opts->keep_appearance) sd = fmax(sd, p->opts->point_sd);
    if (!s) s = take_points(p, far_off(p, sd), &t, err);
    if (!s) s = sdm_fit_groups_find(&t, &groups, err);
    if (!s && groups.largest) doubt_patch(p, &t, &groups, sd, v);
    sdm_free(t.x);
    sdm_free(t.distance);
    return s;
}
