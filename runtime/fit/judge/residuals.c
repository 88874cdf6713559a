/* Residuals of voxels and of points, and the noise that they contain. */
#include "residuals.h"

#include <math.h>

#include "fit/points/shared_errors.h"
#include "fit/trust/posterior.h"
#include "noise.h"
#include "sdm/internal/heap.h"

// a voxel whose share differs from 0 or 1 by at most this much lies deep outside or deep inside
#define DEEP 0.01
// where fewer voxels lie deep, as in a thin shape, the purest ones take their place: this much
#define DEEP_MIN 50
#define NEARLY_DEEP 0.2
// with fewer of them, in a shape thinner than the point spread, the tissue of the fit is the
// measure
#define DEEP_LEAST 8
// images: inside voxels that measure the noise there; of fewer the variance is known to less than
// a sixth
#define INSIDE_MIN 300
// most values of which a median is computed; of more, every second, third ... one is taken
#define VALUES_MAX 20000
// a value so many sd beyond that of the inside is a third material (air beside fluid)
#define BEYOND 4.0
// smallest sd of the noise, as a share: labels have none, but show shares only to a few per cent
#define SD_MIN 0.02
// an outside tissue whose mean lies farther than this share of the way to the inside is another one
#define BETWEEN_MAX 0.75
// the spread inside is at most this factor above what the differences of neighbours say
#define WIDER 1.5
// images whose wide point spread leaves no voxel near the shape fully outside: so many voxels that
// lie mostly outside measure the noise there. They must be many, because neighbouring voxels have
// correlated noise
#define MIXED_MIN 2000
// largest place along an axis; points farther away, in units of the radius, share a place
#define PLACE_MAX 1e5
// correlations below this count as none
#define CORRELATION_MIN 0.05
// where pairs become too few to measure it, a larger one says that noise reaches farther
#define CORRELATION_OPEN 0.2

static bool is_voxels(const fit_problem *p) { return p->target->kind != SDM_FIT_POINTS; }

// share of the inside that the shape predicts; where the field is the distance: the edge of labels
// or of the point spread
static double predicted_share(const fit_problem *p, double field)
{
    if (p->maps.share) return fmin(fmax(field, 0), 1);
    if (fit_is_labels(p)) return fmin(fmax(0.5 - field / p->target->grid.spacing[0], 0), 1);
    return 0.5 * erfc(field / p->opts->blur * 0.70710678118654752);
}

static double tissue_weight(const fit_problem *p, size_t i, size_t tissue)
{
    const float *local = fit_sample_weights(&p->samples, i);
    return local ? exp((double)local[tissue - p->observation.n_in])
                 : p->observation.tissue[tissue].weight;
}

// the tissue with the largest weight inside (side 1) or outside (side 0)
static const sdm_fit_law *main_tissue(const fit_problem *p, int side)
{
    const fit_observation *o = &p->observation;
    const size_t first = side ? 0 : o->n_in, end = side ? o->n_in : o->n_tissues;
    size_t most = first;
    for (size_t k = first; k < end; k++)
        if (o->tissue[k].weight > o->tissue[most].weight) most = k;
    return &o->tissue[most];
}

// by how much the mean of all outside tissues at sample i differs from that of the main one
static double outside_shift(const fit_problem *p, size_t i)
{
    const fit_observation *o = &p->observation;
    const double mean = main_tissue(p, 0)->mean;
    double sum = 0;
    for (size_t k = o->n_in; k < o->n_tissues; k++)
        sum += (o->tissue[k].mean - mean) * tissue_weight(p, i, k);
    return sum;
}

/* The outside tissues at a sample of a tissue field: mean, and their variance with that between
 * them, over the variance of the tissue that r->middle[0] and r->spread[0] describe. */
typedef struct outside_values {
    double mean, variance_ratio;
} outside_values;

/* A tissue of the field that would excuse material which the shape misses is left out: one beyond
 * the inside, as air is for fluid in bone, since it and the main tissue together pass for the
 * inside; and one whose mean has left the values at the start, since it describes the misfit. */
static bool is_excuse(const fit_problem *p, size_t tissue, double way)
{
    const sdm_fit_law *given = &p->opts->appearance.outside[tissue - p->observation.n_in];
    const double off = p->observation.tissue[tissue].mean - given->mean;
    return way > BETWEEN_MAX || fabs(off) > FIT_GIVEN_MAX * given->sd;
}

static outside_values outside_at(const fit_problem *p, const fit_residuals *r, size_t i)
{
    const fit_observation *o = &p->observation;
    const double contrast = r->middle[1] - r->middle[0];
    size_t near = o->n_in;
    for (size_t k = o->n_in; k < o->n_tissues; k++)
        if (fabs(o->tissue[k].mean - r->middle[0]) < fabs(o->tissue[near].mean - r->middle[0]))
            near = k;
    const sdm_fit_law *reference = &o->tissue[near];
    double weight = 0, shift = 0, variance = 0;
    for (size_t k = o->n_in; k < o->n_tissues; k++) {
        const sdm_fit_law *t = &o->tissue[k];
        const double w = tissue_weight(p, i, k), d = t->mean - reference->mean;
        if (k != near && is_excuse(p, k, d / contrast)) continue;
        weight += w;
        shift += w * d;
        variance += w * (t->sd * t->sd + d * d);
    }
    if (!(weight > 0)) return (outside_values){r->middle[0], 1};
    shift /= weight;
    variance = variance / weight - shift * shift;
    return (outside_values){r->middle[0] + shift, variance / (reference->sd * reference->sd)};
}

// whether sample i lies inside (side 1) or outside (side 0), at most `limit` from pure
static bool is_pure(const fit_residuals *r, size_t i, int side, double limit)
{
    return fabs(r->expected[i] - side) <= limit;
}

// the value of one side at sample i, of which a part may lie on the other side
static double side_value(const fit_problem *p, const fit_residuals *r, size_t i, int side)
{
    const double a = r->expected[i], value = (double)p->samples.value[i];
    if (!side) return (value - a * main_tissue(p, 1)->mean) / (1 - a);
    return (value - (1 - a) * (r->middle[0] + outside_shift(p, i))) / a;
}

// middle and spread of the values on one side
static void side_measure(const fit_problem *p, fit_residuals *r, int side, double *list)
{
    const bool image = !fit_is_labels(p);
    size_t least = image && side == 1 ? INSIDE_MIN : DEEP_MIN;
    double limit = DEEP;
    size_t n = 0;
    for (size_t i = 0; i < r->n; i++) n += is_pure(r, i, side, limit);
    if (image && side == 0 && n < least) least = MIXED_MIN;
    while (n < least && limit < NEARLY_DEEP) {
        limit = image ? fmin(2 * limit, NEARLY_DEEP) : NEARLY_DEEP;
        n = 0;
        for (size_t i = 0; i < r->n; i++) n += is_pure(r, i, side, limit);
    }
    // with a wide point spread no voxel near the shape may lie deep outside
    const bool unmix = image && (side == 1 || limit > DEEP);
    const size_t step = n / VALUES_MAX + 1;
    size_t seen = 0, kept = 0;
    for (size_t i = 0; i < r->n; i++)
        if (is_pure(r, i, side, limit) && seen++ % step == 0)
            list[kept++] = unmix ? side_value(p, r, i, side) : (double)p->samples.value[i];
    r->n_deep[side] = n;
    r->deep[side] = unmix ? limit : DEEP;
    r->middle[side] = sdm_fit_shortest_half(list, kept, &r->spread[side]);
    if (r->n_deep[side] < DEEP_LEAST) {
        const sdm_fit_law *tissue = main_tissue(p, side);
        r->middle[side] = tissue->mean, r->spread[side] = tissue->sd;
    }
    if (!fit_is_labels(p)) return;
    r->middle[side] = side;
    // labels have no noise: where they vary deep inside, the shape lies on two materials
    if (r->n_deep[side] >= DEEP_LEAST) r->spread[side] = 0;
}

// Sets place, expected and residual (observed share less expected share) of every voxel.
static void shares_fill(const fit_problem *p, fit_residuals *r, double *list)
{
    const fit_samples *s = &p->samples;
    for (size_t i = 0; i < r->n; i++) {
        const int64_t *size = p->target->grid.n, v = (int64_t)s->voxel[i], k = (int64_t)p->stride;
        r->place[3 * i] = (int32_t)(v % size[0] / k);
        r->place[3 * i + 1] = (int32_t)(v / size[0] % size[1] / k);
        r->place[3 * i + 2] = (int32_t)(v / size[0] / size[1] / k);
        r->expected[i] = predicted_share(p, s->field[i]);
        r->used[i] = true;
    }
    for (int side = 0; side < 2; side++) side_measure(p, r, side, list);
    const double contrast = r->middle[1] - r->middle[0];
    for (size_t i = 0; i < r->n; i++) {
        r->residual[i] = ((double)s->value[i] - r->middle[0]) / contrast - r->expected[i];
        r->sd[i] = 1;
        // Inside the surface, the outside part of a voxel holds all tissues. Outside of it, a
        // tissue field tells which one a voxel holds; without a field it may be any.
        const double shift = r->expected[i] > 0.5   ? outside_shift(p, i)
                             : p->samples.n_outside ? outside_at(p, r, i).mean - r->middle[0]
                                                    : 0;
        r->residual[i] -= (1 - r->expected[i]) * shift / contrast;
    }
}

// Sets the sd of the noise of every voxel. Leaves out voxels of a third material, and limits values
// that lie beyond the outside.
static void noise_fill(const fit_problem *p, fit_residuals *r)
{
    const double contrast = fabs(r->middle[1] - r->middle[0]);
    double sd[2];
    for (int side = 0; side < 2; side++) sd[side] = fmax(r->spread[side] / contrast, SD_MIN);
    for (size_t i = 0; i < r->n; i++) {
        const double a = r->expected[i], share = r->residual[i] + a,
                     wider =
                         a <= 0.5 && p->samples.n_outside ? outside_at(p, r, i).variance_ratio : 1,
                     outside = sd[0] * sqrt(wider);
        r->used[i] = share < 1 + BEYOND * sd[1];
        r->sd[i] = sqrt(a * sd[1] * sd[1] + (1 - a) * outside * outside);
        r->residual[i] = fmax(share, -BEYOND * outside) - a;
    }
}

/* Look-up of the sample at a place. */
typedef struct lookup {
    int32_t low[3];
    size_t size[3];
    uint32_t *number; /* 1 + sample; 0: none */
} lookup;

static uint32_t *lookup_at(const lookup *l, const int32_t place[3])
{
    size_t k[3];
    for (int a = 0; a < 3; a++) {
        if (place[a] < l->low[a] || (size_t)(place[a] - l->low[a]) >= l->size[a]) return NULL;
        k[a] = (size_t)(place[a] - l->low[a]);
    }
    return &l->number[(k[2] * l->size[1] + k[1]) * l->size[0] + k[0]];
}

static sdm_status lookup_create(const fit_residuals *r, lookup *l, sdm_error *err)
{
    int32_t high[3];
    for (size_t a = 0; a < 3; a++) {
        l->low[a] = INT32_MAX, high[a] = INT32_MIN;
        for (size_t i = 0; i < r->n; i++) {
            if (r->place[3 * i + a] < l->low[a]) l->low[a] = r->place[3 * i + a];
            if (r->place[3 * i + a] > high[a]) high[a] = r->place[3 * i + a];
        }
        l->size[a] = (size_t)(high[a] - l->low[a]) + 1;
    }
    size_t count;
    sdm_status s = sdm_mul(l->size[0] * l->size[1], l->size[2], &count, err);
    if (!s) s = SDM_ALLOC(&l->number, count, "residuals of the fit", err);
    for (size_t i = 0; i < r->n && !s; i++) *lookup_at(l, r->place + 3 * i) = (uint32_t)i + 1;
    return s;
}

// list = differences, in sd of the noise, of pure voxels that lie `lag` steps apart along an axis;
// side 0 or 1: only of that side; returns their number
static size_t differences(const fit_residuals *r, const lookup *l, int axis, int lag, int only,
                          double *list)
{
    const size_t step = r->n / (4 * VALUES_MAX) + 1;
    size_t n = 0;
    for (size_t i = 0; i < r->n && n < VALUES_MAX; i += step) {
        const int side = r->expected[i] > 0.5;
        int32_t at[3] = {r->place[3 * i], r->place[3 * i + 1], r->place[3 * i + 2]};
        at[axis] += lag;
        const uint32_t *found = lookup_at(l, at);
        if ((only >= 0 && side != only) || !r->used[i] || !is_pure(r, i, side, r->deep[side]) ||
            !found || !*found)
            continue;
        const size_t j = *found - 1;
        if (!r->used[j] || !is_pure(r, j, side, r->deep[side])) continue;
        list[n++] = r->residual[i] / r->sd[i] - r->residual[j] / r->sd[j];
    }
    return n;
}

/* Two materials inside a wrong shape widen the spread there, but hardly the differences of
 * neighbours. Image noise is as smooth inside as outside, so that these differences, compared with
 * those outside, limit the spread inside. */
static void spread_limit(fit_residuals *r, const lookup *l, double *list)
{
    double difference[2];
    for (int side = 0; side < 2; side++) {
        const size_t n = differences(r, l, 0, 1, side, list);
        difference[side] = sdm_fit_robust_sd(list, n, 0);
    }
    const double limit = WIDER * r->spread[0] * difference[1] / difference[0];
    if (isfinite(limit)) r->spread[1] = fmin(r->spread[1], limit);
}

static void correlations_measure(fit_residuals *r, const lookup *l, double *list)
{
    for (int axis = 0; axis < 3; axis++)
        for (int lag = 1; lag <= FIT_RESIDUAL_LAGS; lag++) {
            const size_t n = differences(r, l, axis, lag, -1, list);
            const double c = sdm_fit_robust_correlation(list, n);
            if (isnan(c) && l->size[axis] > (size_t)lag &&
                r->correlation[axis][lag - 1] > CORRELATION_OPEN)
                r->unmeasured = true;
            if (!(c >= CORRELATION_MIN)) break;
            r->correlation[axis][lag] = c;
        }
}

static sdm_status voxels_fill(const fit_problem *p, fit_residuals *r, double radius, double *list,
                              sdm_error *err)
{
    lookup l = {0};
    shares_fill(p, r, list);
    const sdm_status s = lookup_create(r, &l, err);
    if (!s) {
        spread_limit(r, &l, list);
        noise_fill(p, r);
        correlations_measure(r, &l, list);
    }
    for (int a = 0; a < 3; a++)
        r->edge[a] = (int32_t)fmax(
            floor(0.5 * radius / (p->target->grid.spacing[a] * (double)p->stride) + 0.5), 2);
    sdm_free(l.number);
    return s;
}

/* Error (mm) of the maps near the surface: of the network, and of trilinear interpolation of the
 * distance from a sphere between voxels of edge h: its mean is h^2 / (12 radius) along each of the
 * two directions across the radius. */
static double maps_error(const fit_problem *p, double radius)
{
    const double h = fit_longest_edge(&p->maps.grid);
    return hypot(sdm_fit_network_error(p), radius > 0 ? h * h / (6 * radius) : 0);
}

// Voxels: the share changes with the distance by that of a plane seen with a Gaussian point spread.
// The density at the quantile of the share a, exp(-z^2 / 2) / sqrt(2 pi), is close to 1.6 a (1 -
// a).
static void map_errors_fill(const fit_problem *p, fit_residuals *r, double radius)
{
    const double error = maps_error(p, radius), h = is_voxels(p) ? p->target->grid.spacing[0] : 0,
                 width = hypot(p->state.blur, h / sqrt(12));
    r->label_width = is_voxels(p) && fit_is_labels(p) ? width / h : 0;
    for (size_t i = 0; i < r->n; i++)
        r->map_error[i] = is_voxels(p) ? error * 1.6 * r->expected[i] * (1 - r->expected[i]) / width
                                       : error / radius;
}

static void set_place(fit_residuals *r, size_t i, const double x[3], double radius)
{
    for (size_t a = 0; a < 3; a++) {
        const double place = floor(2 * x[a] / radius);
        r->place[3 * i + a] = (int32_t)fmax(fmin(place, PLACE_MAX), -PLACE_MAX);
    }
}

// points: distances over the largest radius; their noise is the scatter of the distances
static void points_fill(const fit_problem *p, fit_residuals *r, double radius)
{
    for (size_t i = 0; i < r->n; i++) {
        r->expected[i] = 1;
        r->used[i] = sdm_fit_point_belongs(&p->observation, p->samples.field[i]) >= 0.5;
        r->residual[i] = p->samples.field[i] / radius;
        set_place(r, i, p->samples.world + 3 * i, radius);
    }
}

void sdm_fit_residuals_use_feet(const fit_problem *p, fit_residuals *r)
{
    const double radius = sdm_fit_inradius(&p->maps);
    for (size_t i = 0; i < r->n; i++) {
        double foot[3];
        sdm_fit_foot(p, i, foot);
        set_place(r, i, foot, radius);
    }
    r->at_feet = true;
}

sdm_status sdm_fit_residuals_create(const fit_problem *p, fit_residuals *out, sdm_error *err)
{
    fit_residuals *r = out;
    *r = (fit_residuals){.n = p->samples.n, .edge = {1, 1, 1}};
    for (int a = 0; a < 3; a++) r->correlation[a][0] = 1;
    double *list = NULL;
    sdm_status s = SDM_ALLOC(&r->expected, r->n, "residuals of the fit", err);
    if (!s) s = SDM_ALLOC(&r->residual, r->n, "residuals of the fit", err);
    if (!s) s = SDM_ALLOC(&r->sd, r->n, "residuals of the fit", err);
    if (!s) s = SDM_ALLOC(&r->map_error, r->n, "residuals of the fit", err);
    if (!s) s = SDM_ALLOC(&r->used, r->n, "residuals of the fit", err);
    if (!s) s = SDM_ALLOC(&r->place, 3 * r->n, "residuals of the fit", err);
    if (!s) s = SDM_ALLOC(&list, r->n, "residuals of the fit", err);
    const double radius = sdm_fit_inradius(&p->maps);
    if (!s && is_voxels(p))
        s = voxels_fill(p, r, radius, list, err);
    else if (!s)
        points_fill(p, r, radius);
    if (!s) map_errors_fill(p, r, radius);
    sdm_free(list);
    return s;
}

// A larger correlation at the last lag is that of an image without noise, or of noise that reaches
// farther than the lags.
#define CORRELATION_LAST_MAX 0.5

double sdm_fit_residual_correlation(const fit_residuals *r)
{
    double product = 1;
    if (r->unmeasured) return 0;
    for (int a = 0; a < 3; a++) {
        double sum = 1;
        if (r->correlation[a][FIT_RESIDUAL_LAGS] > CORRELATION_LAST_MAX) return 0;
        for (int lag = 1; lag <= FIT_RESIDUAL_LAGS; lag++) sum += 2 * r->correlation[a][lag];
        product *= sum;
    }
    return product > 1 ? product : 0;
}

void sdm_fit_residuals_dispose(fit_residuals *r)
{
    sdm_free(r->expected);
    sdm_free(r->residual);
    sdm_free(r->sd);
    sdm_free(r->map_error);
    sdm_free(r->used);
    sdm_free(r->place);
    *r = (fit_residuals){0};
}
