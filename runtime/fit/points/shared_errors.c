/* The ratio of the mean square distance to the mean square difference of neighbours is the inverse
 * of von Neumann's ratio (1941), with neighbours on a surface in place of successors in time. For
 * independent normal errors it is 1 with the standard deviation sqrt(2 / n). */
#include "shared_errors.h"

#include <math.h>

#include "fit/data/interpolate.h"
#include "fit/trust/posterior.h"
#include "pick.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

// points of which the neighbours tell the scatter
#define POINTS_MIN 100
// most pairs of points that are compared: of more points, the neighbours of every second, third ...
// one are looked for
#define PAIRS_MAX 4e7
// points that lie farther apart than this multiple of their scatter are neighbours as they lie: the
// variance is then too small by some 10 %
#define SPACING_MIN 5.0
// share of the mean square distance that neighbours may have in common
#define SHARED_MAX 0.5
// standard normal deviate that chance exceeds once in a thousand fits
#define ONCE_IN_THOUSAND 3.09
// standard deviation of errors of the surface over the largest radius: facets
#define FACETS 0.005
// smallest square of the gradient of a distance that leads to the surface
#define GRADIENT_MIN 0.25

void sdm_fit_foot(const fit_problem *p, size_t i, double foot[3])
{
    const fit_field map = sdm_fit_maps_distances(&p->maps);
    double y[3], gradient[3];
    sdm_fit_to_shape(&p->state, p->samples.world + 3 * i, y);
    const double distance = sdm_fit_interpolate_all(&map, y, gradient, NULL),
                 square = v3_dot(gradient, gradient);
    for (int a = 0; a < 3 && square > GRADIENT_MIN; a++) y[a] -= distance * gradient[a] / square;
    sdm_fit_to_world(&p->state, y, foot);
}

/* The point at the nearest place; points at the same place are the same one twice. */
static size_t nearest(const double (*place)[3], size_t n, size_t i, double *distance)
{
    double least = INFINITY;
    size_t found = i;
    for (size_t j = 0; j < n; j++) {
        const double d = v3_dist2(place[i], place[j]);
        if (d < least && d > 0) least = d, found = j;
    }
    *distance = sqrt(least);
    return found;
}

/* Nearest neighbours by some places. */
typedef struct neighbours {
    size_t n;       // number of points that have one
    double scatter; // root of half of the mean square difference of their distances, mm
    double spacing; // geometric mean of how far they are apart, mm
} neighbours;

static neighbours compare_neighbours(const double (*place)[3], const double *distance, size_t n)
{
    const size_t step = (size_t)ceil(fmax((double)n * (double)n / PAIRS_MAX, 1));
    neighbours found = {0};
    double square = 0, log_apart = 0;
    for (size_t k = 0; k * step < n; k++) {
        double apart;
        const size_t i = fit_pick(step, k), other = i < n ? nearest(place, n, i, &apart) : i;
        if (other == i) continue;
        const double d = distance[i] - distance[other];
        square += 0.5 * d * d;
        log_apart += log(apart);
        found.n++;
    }
    if (!found.n) return found;
    found.scatter = sqrt(square / (double)found.n);
    found.spacing = exp(log_apart / (double)found.n);
    return found;
}

void sdm_fit_shared_errors_of(const double (*place)[3], const double (*foot)[3],
                              const double *distance, size_t n, double facets,
                              fit_shared_errors *out)
{
    const neighbours at_feet = compare_neighbours(foot, distance, n),
                     as_they_lie = compare_neighbours(place, distance, n);
    const bool apart = as_they_lie.spacing > SPACING_MIN * as_they_lie.scatter;
    double square = 0;
    *out = (fit_shared_errors){0};
    if (at_feet.n < POINTS_MIN) return;
    for (size_t i = 0; i < n; i++) square += distance[i] * distance[i] / (double)n;
    out->n = at_feet.n;
    out->all = sqrt(square);
    out->near = apart ? fmin(at_feet.scatter, as_they_lie.scatter) : at_feet.scatter;
    out->ratio = square / pow(fmax(out->near, facets), 2);
    out->limit = (1 + ONCE_IN_THOUSAND * sqrt(2 / (double)out->n)) / (1 - SHARED_MAX);
}

sdm_status sdm_fit_shared_errors(const fit_problem *p, const bool *used, fit_shared_errors *out,
                                 sdm_error *err)
{
    double(*place)[3] = NULL, (*foot)[3] = NULL, *distance = NULL;
    size_t n = 0;
    *out = (fit_shared_errors){0};
    sdm_status s = SDM_ALLOC(&place, p->samples.n, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&foot, p->samples.n, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&distance, p->samples.n, "points of the fit", err);
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        if (!used[i]) continue;
        for (size_t a = 0; a < 3; a++) place[n][a] = p->samples.world[3 * i + a];
        sdm_fit_foot(p, i, foot[n]);
        distance[n++] = p->samples.field[i];
    }
    const double radius = sdm_fit_inradius(&p->maps),
                 maps = fit_maps_direct(&p->maps) ? 0 : sdm_fit_network_error(p);
    if (!s)
        sdm_fit_shared_errors_of((const double(*)[3])place, (const double(*)[3])foot, distance, n,
                                 hypot(FACETS * radius, maps), out);
    sdm_free(place);
    sdm_free(foot);
    sdm_free(distance);
    return s;
}
