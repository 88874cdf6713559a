/* Whether the data want parameters beyond the bounds at which the fit has stopped them. */
#include "bounds.h"

#include <math.h>
#include <stdio.h>

#include <stdlib.h>
#include <string.h>

#include "fit/data/source_params.h"
#include "sdm/memory.h"

// a difference of lengths below this share of the length, or below this number of voxels of the
// labels or deviations of the points, explains nothing
#define DIFFERENCE_MIN 0.02
#define STEPS_MIN 1.5
// a difference of lengths above this share of the length refutes a parameter at its bound
#define DIFFERENCE_FAR 0.05
// a parameter that changes a length by less than this, mm per unit, does not explain it
#define SLOPE_MIN 0.3
// the value that the data want, beyond the bound: at most this part of the width of the range;
// farther, other things lie in the data
#define BEYOND_MAX 1.0
// least component of the gradient of a distance that points along an axis
#define ALONG 0.95
// ends of the shape that differ by less than this, in voxels, are the same
#define SAME_END 0.1
// points: this part of them may lie beyond each end: strays
#define STRAYS 0.002

/* Gain in log-likelihood by the Newton step of parameter k alone, where it leads out of the range;
 * else 0. The other unknowns stay, which makes the gain smaller than it is. */
static double gain_beyond(const fit_problem *p, size_t k, bool upper)
{
    const fit_information *f = &p->information;
    const double slope = f->gradient[k] * (upper ? 1 : -1),
                 curvature = f->complete[k * (f->n_unknowns + 1)];
    return slope > 0 && curvature > 0 ? 0.5 * slope * slope / curvature : 0;
}

fit_at_bounds sdm_fit_at_bounds(const fit_problem *p, const sdm_fit_result *r, double factor)
{
    fit_at_bounds b = {.n = 0};
    double most = SDM_FIT_PREFERRED, hinted = 0;
    for (size_t k = 0; k < p->n_params && !p->opts->keep_params; k++) {
        const bool upper = p->state.params[k] >= p->high[k];
        if (!r->at_bound[k]) continue;
        b.n++;
        const char *name = "";
        double low, high;
        sdm_fit_bounds(p->source, k, &low, &high, &name);
        const size_t length = strlen(b.names);
        if (length + strlen(name) + 3 < sizeof b.names)
            snprintf(b.names + length, sizeof b.names - length, "%s%s", length ? ", " : "", name);
        const double gain = gain_beyond(p, k, upper) / factor;
        // of a parameter that they do not determine the data want nothing
        if (gain > hinted && !r->by_prior[k])
            snprintf(b.hint, sizeof b.hint,
                     "the data may want %.60s to be %s than %.6g, the %s value of its range", name,
                     upper ? "more" : "less", upper ? p->high[k] : p->low[k],
                     upper ? "largest" : "smallest");
        if (!r->by_prior[k]) hinted = fmax(hinted, gain);
        if (!(gain > SDM_FIT_PREFERRED)) continue;
        b.n_wanted++;
        if (!(gain > most)) continue;
        most = gain;
        snprintf(b.text, sizeof b.text,
                 "%.60s ends at its bound: the data want %s than %.6g, the %s value of its range",
                 name, upper ? "more" : "less", upper ? p->high[k] : p->low[k],
                 upper ? "largest" : "smallest");
    }
    return b;
}

/* Lengths along an axis of the shape's frame, mm, and derivatives of that of the shape. */
typedef struct lengths {
    double data, shape, by[FIT_PARAMS_MAX];
} lengths;

/* Where the surface ends along an axis, as the voxel v beyond it (sign 1: above; -1: below) says:
 * its coordinate less the distance, if the gradient of the distance points along the axis. NaN: it
 * does not. */
static double surface_end(const fit_maps *m, const int64_t at[3], int axis, int sign)
{
    const sdm_grid *g = &m->grid;
    const int64_t step[3] = {1, g->n[0], g->n[0] * g->n[1]};
    if (at[axis] < 1 || at[axis] + 1 >= g->n[axis]) return NAN;
    const double *d = m->distance + sdm_grid_voxel(g, at[0], at[1], at[2]);
    const double slope = (d[step[axis]] - d[-step[axis]]) / (2 * g->spacing[axis]);
    double x[3];
    if (!(*d >= 0) || !(sign * slope > ALONG)) return NAN;
    sdm_grid_world(g, (double[3]){(double)at[0], (double)at[1], (double)at[2]}, x);
    return x[axis] - sign * *d;
}

/* One end of the shape along an axis: *end = its coordinate, mm; by[n_params] = derivatives of the
 * length by the parameters, a mean over the voxels that show the end. No such voxel: *end is not
 * finite. */
static void measure_end(const fit_problem *p, int axis, int sign, double *end, double *by)
{
    const fit_maps *m = &p->maps;
    const int64_t *n = m->grid.n;
    double all = 0, sum[FIT_PARAMS_MAX] = {0};
    int64_t at[3];
    *end = sign > 0 ? -INFINITY : INFINITY;
    for (int pass = 0; pass < 2; pass++)
        for (at[2] = 0; at[2] < n[2]; at[2]++)
            for (at[1] = 0; at[1] < n[1]; at[1]++)
                for (at[0] = 0; at[0] < n[0]; at[0]++) {
                    const double here = surface_end(m, at, axis, sign);
                    const size_t v = sdm_grid_voxel(&m->grid, at[0], at[1], at[2]);
                    if (isnan(here)) continue;
                    if (!pass) *end = sign > 0 ? fmax(*end, here) : fmin(*end, here);
                    if (!pass || fabs(here - *end) > SAME_END * m->grid.spacing[axis]) continue;
                    for (size_t k = 0; k < p->n_params; k++)
                        sum[k] -= (double)m->jacobian[k * m->n_voxels + v];
                    all++;
                }
    for (size_t k = 0; k < p->n_params && all > 0; k++) by[k] += sum[k] / all;
}

static void measure_shape(const fit_problem *p, int axis, lengths *out)
{
    double end[2];
    memset(out->by, 0, sizeof out->by);
    measure_end(p, axis, -1, &end[0], out->by);
    measure_end(p, axis, 1, &end[1], out->by);
    out->shape = end[1] - end[0];
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static sdm_status measure_points(const fit_problem *p, lengths out[3], sdm_error *err)
{
    const size_t n = p->target->n_points, cut = (size_t)(STRAYS * (double)n);
    double *list = NULL;
    const sdm_status s = SDM_ALLOC(&list, n, "coordinates of points", err);
    for (int axis = 0; axis < 3 && !s; axis++) {
        for (size_t i = 0; i < n; i++) {
            double y[3];
            sdm_fit_to_shape(&p->state, p->target->points + 3 * i, y);
            list[i] = y[axis];
        }
        qsort(list, n, sizeof *list, ascending);
        out[axis].data = list[n - 1 - cut] - list[cut];
    }
    sdm_free(list);
    return s;
}

static void measure_labels(const fit_problem *p, lengths out[3])
{
    const sdm_grid *g = &p->target->grid;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                double x[3], y[3];
                if (!(p->target->values[sdm_grid_voxel(g, i, j, k)] > 0.5f)) continue;
                sdm_grid_world(g, (double[3]){(double)i, (double)j, (double)k}, x);
                sdm_fit_to_shape(&p->state, x, y);
                for (int a = 0; a < 3; a++)
                    low[a] = fmin(low[a], y[a]), high[a] = fmax(high[a], y[a]);
            }
    // the outer voxels reach half of an edge beyond their centres
    for (int a = 0; a < 3; a++) out[a].data = high[a] - low[a] + fit_longest_edge(g);
}

sdm_status sdm_fit_measure_beyond(const fit_problem *p, const sdm_fit_result *r, fit_at_bounds *b,
                                  sdm_error *err)
{
    const bool points = p->target->kind == SDM_FIT_POINTS;
    lengths along[3];
    double most = 0;
    if (!b->n || p->opts->keep_params || !p->maps.jacobian) return SDM_OK;
    sdm_status s = points ? measure_points(p, along, err) : SDM_OK;
    if (s) return s;
    if (!points) measure_labels(p, along);
    for (int axis = 0; axis < 3; axis++) measure_shape(p, axis, &along[axis]);
    for (size_t k = 0; k < p->n_params; k++) {
        const bool upper = p->state.params[k] >= p->high[k];
        const double width = p->high[k] - p->low[k], bound = upper ? p->high[k] : p->low[k];
        for (int axis = 0; axis < 3 && r->at_bound[k]; axis++) {
            const lengths *l = &along[axis];
            const double step = points ? p->state.point_sd : fit_longest_edge(&p->target->grid),
                         more = l->data - l->shape, beyond = more / l->by[k];
            if (!isfinite(more) || !(fabs(l->by[k]) > SLOPE_MIN) || (beyond > 0) != upper ||
                !(fabs(beyond) < BEYOND_MAX * width) || !(fabs(more) > most) ||
                !(fabs(more) > fmax(DIFFERENCE_MIN * l->shape, STEPS_MIN * step)))
                continue;
            const char *name = "";
            double low, high;
            most = fabs(more);
            sdm_fit_bounds(p->source, k, &low, &high, &name);
            snprintf(b->text, sizeof b->text,
                     "the data want %.40s = %.3g, beyond its range %.6g .. %.6g: they are %.4g mm "
                     "long along %c of the shape, the shape at its bound %.4g mm",
                     name, bound + beyond, p->low[k], p->high[k], l->data, "xyz"[axis], l -> shape);
            b->measured = true;
            b->far = b->n_wanted && fabs(more) > DIFFERENCE_FAR * l->shape;
        }
    }
    if (b->measured && !b->n_wanted) b->n_wanted = 1;
    return SDM_OK;
}
