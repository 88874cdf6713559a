/* Units of samples, their mean residuals and the variances of these. */
#include "misfit.h"

#include <math.h>
#include <stdlib.h>

#include "fit/data/step_phase.h"
#include "noise.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

// members of a unit between which correlations are computed; of more, every second, third ... one
#define MEMBERS_MAX 64
// points: members with companions that measure the scatter to the NOISE_UNCERTAINTY of its variance
#define SCATTER_MIN 100
// points: fewer units than this tell little
#define UNITS_MIN 10
// points: largest edge of a cube, in halves of the largest radius
#define POINTS_EDGE_MAX 2
// a unit contradicts the shape if its mean exceeds this number of standard deviations
#define BEYOND 3.0
// smallest sd of a unit's mean, as a share: errors of the maps and of the scale of the shares
#define MEAN_SD_MIN 0.02
// points: the same, over the largest radius, where their errors are independent: facets
#define POINTS_SD_MIN 0.005
// points: the correlation of neighbours is known to this
#define CORRELATION_ERROR 0.05
// points of a unit whose nearest neighbours are looked for
#define NEAREST_MAX 200
// rms error of the place of a surface that labels show, in voxels
#define LABEL_ERROR 0.12
// the density at the quantile of the share a is close to DENSITY a (1 - a)
#define DENSITY 1.6
// shares below this and above 1 less this tell no distance
#define SHARE_MIN 0.02
// relative uncertainty of the variance of the noise
#define NOISE_UNCERTAINTY 0.2
// standard normal deviate that noise exceeds once in a thousand fits
#define ONCE_IN_THOUSAND 3.09

/* A sample and the unit to which it belongs. */
typedef struct member {
    uint64_t unit;
    uint32_t sample;
} member;

static int by_unit(const void *a, const void *b)
{
    const member *x = a, *y = b;
    if (x->unit != y->unit) return x->unit < y->unit ? -1 : 1;
    return (x->sample > y->sample) - (x->sample < y->sample);
}

// number of the cube and the side of sample i; 20 bits along each axis
static uint64_t unit_of(const fit_residuals *r, size_t i)
{
    uint64_t unit = 0;
    for (size_t a = 0; a < 3; a++) {
        const int64_t cube = (int64_t)floor((double)r->place[3 * i + a] / (double)r->edge[a]);
        unit = unit << 20 | ((uint64_t)(cube + (1 << 19)) & 0xfffff);
    }
    return unit << 1 | (r->expected[i] > 0.5);
}

static double pair_correlation(const fit_residuals *r, size_t i, size_t j)
{
    double c = 1;
    for (size_t a = 0; a < 3; a++) {
        const int lag = abs(r->place[3 * i + a] - r->place[3 * j + a]);
        c *= lag <= FIT_RESIDUAL_LAGS ? r->correlation[a][lag] : 0;
    }
    return c;
}

// mean correlation of two different members of a unit
static double mean_correlation(const fit_residuals *r, const member *m, size_t n)
{
    const size_t step = (n + MEMBERS_MAX - 1) / MEMBERS_MAX;
    double sum = 0, pairs = 0;
    for (size_t x = 0; x < n; x += step)
        for (size_t y = 0; y < x; y += step, pairs++)
            sum += pair_correlation(r, m[x].sample, m[y].sample);
    return pairs > 0 ? sum / pairs : 0;
}

/* Mean of the residuals of a unit; its variance by noise (with the steps of labels), and by noise
 * and errors of the maps; mean of the expected shares. */
typedef struct unit_mean {
    double mean, noise, variance, expected;
} unit_mean;

/* Labels show a surface in steps of a voxel. Where a surface runs obliquely through a unit, the
 * steps average out; where it is parallel to the voxels, all of it is off by the same part of a
 * step. Returns the sd of this error of the mean share: the sd of a step, where the distances of
 * the members from the surface are the same modulo a voxel, and less where they are not: times the
 * length of the mean of exp(2 pi i distance). The members count by their change of the share. */
static double unit_steps(const fit_residuals *r, const member *m, size_t n)
{
    fit_step_phase f = {0};
    for (size_t k = 0; k < n && r->label_width > 0; k++) {
        const double a = fmin(fmax(r->expected[m[k].sample], SHARE_MIN), 1 - SHARE_MIN),
                     slope = DENSITY * a * (1 - a) / r->label_width,
                     distance = r->label_width * log(a / (1 - a)) / DENSITY;
        fit_step_phase_add(&f, slope, distance);
    }
    const double square = f.turn[0] * f.turn[0] + f.turn[1] * f.turn[1];
    return f.all > 0 ? FIT_STEP_SD * square / (f.all * (double)n) : 0;
}

static unit_mean unit_measure(const fit_residuals *r, const member *m, size_t n, double least)
{
    double sum = 0, variance = 0, expected = 0, maps = 0;
    for (size_t k = 0; k < n; k++) {
        sum += r->residual[m[k].sample];
        expected += r->expected[m[k].sample];
        maps += r->map_error[m[k].sample];
        variance += r->sd[m[k].sample] * r->sd[m[k].sample];
    }
    const double one = 1 / (double)n, shared = (1 - one) * mean_correlation(r, m, n);
    const double steps = unit_steps(r, m, n),
                 noise = variance * one * (one + shared) + least * least + steps * steps;
    return (unit_mean){sum * one, noise, noise + maps * one * maps * one, expected * one};
}

// The share of a unit that the data contradict. At most the expected share can be empty: a value
// beyond that of the outside is another tissue there.
static double contradicted(const unit_mean *u)
{
    return u->mean < 0 ? fmin(-u->mean, u->expected) : u->mean;
}

/* Points: the sd of every distance is the robust scatter about the means of the units, which a
 * displacement of a whole unit does not change. Of n points the scatter about their own mean is
 * smaller by sqrt((n - 1) / n). Where too few points have companions, it is the robust scatter
 * about the surface. */
static sdm_status points_scatter(fit_residuals *r, const member *m, size_t n, sdm_error *err)
{
    double *list = NULL;
    size_t count = 0;
    const sdm_status s = SDM_ALLOC(&list, n, "residuals of the fit", err);
    for (size_t from = 0, to; from < n && !s; from = to) {
        double sum = 0;
        for (to = from; to < n && m[to].unit == m[from].unit; to++)
            sum += r->residual[m[to].sample];
        const double size = (double)(to - from);
        for (size_t k = from; k < to && size > 1; k++)
            list[count++] = (r->residual[m[k].sample] - sum / size) * sqrt(size / (size - 1));
    }
    if (count < SCATTER_MIN && !s)
        for (count = 0; count < n; count++) list[count] = r->residual[m[count].sample];
    const double sd = count ? sdm_fit_robust_sd(list, count, 0) : 0;
    for (size_t i = 0; i < r->n; i++) r->sd[i] = sd;
    sdm_free(list);
    return s;
}

// number of members that share their unit with others
static size_t companions(const member *m, size_t n)
{
    size_t count = 0;
    for (size_t k = 0; k < n; k++)
        count += (k && m[k - 1].unit == m[k].unit) || (k + 1 < n && m[k + 1].unit == m[k].unit);
    return count;
}

/* The nearest other member of a unit. */
static size_t nearest(const fit_problem *p, const member *m, size_t n, size_t k)
{
    const double *x = p->samples.world + 3 * (size_t)m[k].sample;
    double least = INFINITY;
    size_t found = k;
    for (size_t j = 0; j < n; j++) {
        const double d = v3_dist2(x, p->samples.world + 3 * (size_t)m[j].sample);
        if (j != k && d < least) least = d, found = j;
    }
    return found;
}

/* *correlation = that of the errors of two neighbouring points of a unit: 1 less (half the variance
 * of the difference of nearest neighbours) / (variance of the points about the means of their
 * units). Both variances are robust, so that a few units on another shape do not change them. */
static sdm_status points_correlation(const fit_problem *p, const fit_residuals *r, const member *m,
                                     size_t n, double *correlation, sdm_error *err)
{
    double *list = NULL;
    size_t count = 0;
    const sdm_status s = SDM_ALLOC(&list, n, "residuals of the fit", err);
    for (size_t from = 0, to; from < n && !s; from = to) {
        for (to = from; to < n && m[to].unit == m[from].unit; to++) {
        }
        const size_t size = to - from, step = (size + NEAREST_MAX - 1) / NEAREST_MAX;
        for (size_t k = 0; k < size && size > 1; k += step) {
            const size_t j = nearest(p, m + from, size, k);
            list[count++] = (r->residual[m[from + k].sample] - r->residual[m[from + j].sample]) *
                            0.70710678118654752;
        }
    }
    const double sd = count ? sdm_fit_robust_sd(list, count, 0) : 0, all = r->n ? r->sd[0] : 0;
    *correlation =
        count >= SCATTER_MIN && all > 0 ? fmin(fmax(1 - sd * sd / (all * all), 0), 1) : 1;
    sdm_free(list);
    return s;
}

// area of the surface times the largest radius, over the volume of the shape: the part of the
// volume that a displacement of the whole surface by this radius stands for
static double points_volume_factor(const fit_problem *p)
{
    const double h = fit_longest_edge(&p->maps.grid);
    size_t inside = 0, near = 0;
    for (size_t v = 0; v < p->maps.n_voxels; v++) {
        inside += p->maps.distance[v] < 0;
        near += fabs(p->maps.distance[v]) < h;
    }
    return inside ? (double)near / (2 * h) * sdm_fit_inradius(&p->maps) / (double)inside : 0;
}

// chi-square with correlated units: neighbours share the noise that reaches over the cubes' faces
static double chi_square_limit(const fit_residuals *r, double n_units)
{
    double shared = 1;
    for (int a = 0; a < 3; a++) {
        const int lag = r->edge[a] <= FIT_RESIDUAL_LAGS ? r->edge[a] : FIT_RESIDUAL_LAGS;
        shared *= 1 + 2 * r->correlation[a][lag] * r->correlation[a][lag];
    }
    const double sd = sqrt(2 * shared / n_units);
    return (1 + NOISE_UNCERTAINTY) * (1 + ONCE_IN_THOUSAND * sd);
}

// m[] = the samples that are used, by their units; returns their number
static size_t members_sort(const fit_residuals *r, member *m)
{
    size_t n = 0;
    for (size_t i = 0; i < r->n; i++)
        if (r->used[i]) m[n++] = (member){unit_of(r, i), (uint32_t)i};
    qsort(m, n, sizeof *m, by_unit);
    return n;
}

/* Points: the same with the smallest cubes, at most POINTS_EDGE_MAX, in which enough of them have
 * companions; where no cubes do, with the largest. */
static size_t points_sort(fit_residuals *r, member *m)
{
    for (int32_t edge = 1;; edge++) {
        for (int a = 0; a < 3; a++) r->edge[a] = edge;
        const size_t n = members_sort(r, m);
        if (edge >= POINTS_EDGE_MAX || companions(m, n) >= SCATTER_MIN) return n;
    }
}

// number of voxels inside by the labels that lie too far from the shape to be samples, in samples
static double label_beyond(const fit_problem *p)
{
    const size_t n = sdm_grid_count(&p->target->grid);
    double all = 0, near = 0;
    // of samples at every second voxel, the near ones are known too coarsely
    if (p->opts->use_box || p->stride > 1) return 0;
    for (size_t v = 0; v < n; v++) all += p->target->values[v] > 0.5f;
    for (size_t i = 0; i < p->samples.n; i++) near += p->samples.value[i] > 0.5f;
    return fmax(all - near, 0);
}

// a unit that contradicts the shape, by its mean over the standard deviation; sum[2]: the sums of
// the squares of those with less and with more material than the shape
static void place_add(const fit_problem *p, const member *m, size_t n, double z,
                      fit_worst_place *worst, double sum[2])
{
    sum[z > 0] += z * z;
    if (z * z <= worst->chi_square) return;
    *worst = (fit_worst_place){.chi_square = z * z, .more = z > 0};
    for (size_t k = 0; k < n; k++)
        for (size_t a = 0; a < 3; a++)
            worst->world[a] += p->samples.world[3 * (size_t)m[k].sample + a] / (double)n;
}

sdm_status sdm_fit_misfit(const fit_problem *p, fit_residuals *r, fit_misfit *out, sdm_error *err)
{
    const bool points = p->target->kind == SDM_FIT_POINTS;
    member *m = NULL;
    size_t n = 0;
    *out = (fit_misfit){0};
    sdm_status s = SDM_ALLOC(&m, r->n, "residuals of the fit", err);
    if (!s) n = points ? points_sort(r, m) : members_sort(r, m);
    if (!s && points) s = points_scatter(r, m, n, err);
    if (points) out->n_points = n;
    double volume = 0;
    for (size_t i = 0; i < r->n; i++) volume += r->expected[i];
    // labels show the place of the surface to 0.12 of their voxels
    const bool labels = fit_is_labels(p);
    const double least = labels ? fmax(LABEL_ERROR / r->edge[0], MEAN_SD_MIN) : MEAN_SD_MIN;
    const double factor = points ? points_volume_factor(p) : 1;
    double correlation = 1, sum[2][2] = {{0}};
    if (!s && r->at_feet) s = points_correlation(p, r, m, n, &correlation, err);
    correlation = fmin(correlation + CORRELATION_ERROR, 1);
    if (labels) out->beyond = label_beyond(p), out->missing = out->beyond / volume;
    for (size_t from = 0, to; from < n && !s; from = to) {
        for (to = from; to < n && m[to].unit == m[from].unit; to++) {
        }
        if (to - from < 2) continue;
        const unit_mean u = unit_measure(r, m + from, to - from, least);
        const double z2 = u.mean * u.mean / u.variance;
        const int side = m[from].unit & 1;
        out->n_units[side]++;
        out->chi_square[side] += z2;
        out->noise_chi_square += u.mean * u.mean / u.noise;
        if (r->at_feet) {
            const double one = 1 / (double)(to - from), sd = r->sd[0], maps = r->map_error[0];
            out->scatter_chi_square += u.mean * u.mean /
                                       (sd * sd * (one + (1 - one) * correlation) + maps * maps +
                                        POINTS_SD_MIN * POINTS_SD_MIN);
        }
        if (!(z2 > BEYOND * BEYOND)) continue;
        place_add(p, m + from, to - from, u.mean / sqrt(u.variance), &out->worst[side], sum[side]);
        *(u.mean < 0 ? &out->empty : &out->missing) +=
            factor * contradicted(&u) * (double)(to - from) / volume;
    }
    const double all_units = fmax((double)(out->n_units[0] + out->n_units[1]), 1);
    out->few = points && (out->n_units[1] < UNITS_MIN || companions(m, n) < SCATTER_MIN);
    out->noise_chi_square /= all_units, out->scatter_chi_square /= all_units;
    for (int side = 0; side < 2; side++) {
        const double units = fmax((double)out->n_units[side], 1);
        out->chi_square[side] /= units;
        out->limit[side] = chi_square_limit(r, units);
        const double all = sum[side][0] + sum[side][1];
        out->worst[side].same = all > 0 ? sum[side][out->worst[side].more] / all : 0;
    }
    sdm_free(m);
    return s;
}
