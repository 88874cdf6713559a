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

/* The point with the nearest foot; points with the same foot are the same one twice. */
static size_t nearest(const double (*foot)[3], size_t n, size_t i)
{
    double least = INFINITY;
    size_t found = i;
    for (size_t j = 0; j < n; j++) {
        const double d = v3_dist2(foot[i], foot[j]);
        if (d < least && d > 0) least = d, found = j;
    }
    return found;
}

void sdm_fit_shared_errors_of(const double (*foot)[3], const double *distance, size_t n,
                              double facets, fit_shared_errors *out)
{
    const size_t step = (size_t)ceil(fmax((double)n * (double)n / PAIRS_MAX, 1));
    double all = 0, near = 0;
    *out = (fit_shared_errors){0};
    for (size_t i = 0; i < n; i++) all += distance[i] * distance[i] / (double)n;
    for (size_t k = 0; k * step < n; k++) {
        const size_t i = fit_pick(step, k);
        if (i >= n) break;
        const double d = distance[i] - distance[nearest(foot, n, i)];
        near += 0.5 * d * d;
        out->n++;
    }
    if (out->n < POINTS_MIN) {
        out->n = 0;
        return;
    }
    near /= (double)out->n;
    out->all = sqrt(all), out->near = sqrt(near);
    out->ratio = all / fmax(near, facets * facets);
    out->limit = (1 + ONCE_IN_THOUSAND * sqrt(2 / (double)out->n)) / (1 - SHARED_MAX);
}

sdm_status sdm_fit_shared_errors(const fit_problem *p, const bool *used, fit_shared_errors *out,
                                 sdm_error *err)
{
    double(*foot)[3] = NULL, *distance = NULL;
    size_t n = 0;
    *out = (fit_shared_errors){0};
    sdm_status s = SDM_ALLOC(&foot, p->samples.n, "points of the fit", err);
    if (!s) s = SDM_ALLOC(&distance, p->samples.n, "points of the fit", err);
    for (size_t i = 0; i < p->samples.n && !s; i++) {
        if (!used[i]) continue;
        sdm_fit_foot(p, i, foot[n]);
        distance[n++] = p->samples.field[i];
    }
    const double radius = sdm_fit_inradius(&p->maps),
                 maps = fit_maps_direct(&p->maps) ? 0 : sdm_fit_network_error(p);
    if (!s)
        sdm_fit_shared_errors_of((const double(*)[3])foot, distance, n,
                                 hypot(FACETS * radius, maps), out);
    sdm_free(foot);
    sdm_free(distance);
    return s;
}
