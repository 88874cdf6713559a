/* Covariance of the score of points.

   With the residuals e_i, their roots x_i (the score is e_i x_i) and their correlation c at a
   distance d,

       cov(score) = mean(e^2) sum over pairs i, j of c(d_ij) x_i x_j^T

   (Conley 1999). c has the form c0 (1 - d / R)^2 for 0 < d < R, which is positive definite in space
   (Wendland 1995), and 1 at d = 0. R is where the measured correlation ends, and c0 makes its sum
   over the pairs that of the residuals. All sums run over a random subset of the points. */
#include "point_covariance.h"

#include <math.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/vec3.h"

// size of the subset: for the covariance, and for a rough estimate
#define POINTS_MAX 4000.0
#define POINTS_ROUGH 1500.0
// distances are counted in this number of bins as wide as a voxel of the map
#define BINS 24
// a correlation counts while it exceeds this and twice its standard error
#define CORRELATION_MIN 0.02
// support of the kernel of the error of the maps, in edges of a cube: the kernel has the integral
// of a square of that edge over a surface
#define KERNEL_OVER_CUBE 1.38

/* The subset of the points. */
typedef struct subset {
    size_t n;
    // number of points for each point of the subset
    double scale;
    // [n] number of the point
    size_t *point;
    // [n][3] place on the surface, mm: of points as they lie, those with errors of the same sign
    // would be nearer to each other
    double *place;
    // [n] residual; [n][n_unknowns] root, score by a map error of 1 mm
    double *residual, *root, *model;
} subset;

static void subset_dispose(subset *t)
{
    sdm_free(t->point);
    sdm_free(t->place);
    sdm_free(t->residual);
    sdm_free(t->root);
    sdm_free(t->model);
}

static sdm_status subset_choose(const fit_problem *p, double wanted, subset *t, sdm_error *err)
{
    const fit_samples *s = &p->samples;
    const size_t n = p->information.n_unknowns;
    const double share = wanted / (double)s->n;
    sdm_status status = SDM_ALLOC(&t->point, s->n, "points of the fit", err);
    for (size_t i = 0; i < s->n && !status; i++)
        if (sdm_rng_uniform(0, 0, i) <= share) t->point[t->n++] = i;
    if (!status && !t->n) t->point[t->n++] = 0;
    t->scale = (double)s->n / (double)t->n;
    if (!status) status = SDM_ALLOC(&t->place, 3 * t->n, "points of the fit", err);
    if (!status) status = SDM_ALLOC(&t->residual, t->n, "points of the fit", err);
    if (!status) status = SDM_ALLOC(&t->root, t->n * n, "points of the fit", err);
    if (!status) status = SDM_ALLOC(&t->model, t->n * n, "points of the fit", err);
    for (size_t k = 0; k < t->n && !status; k++) {
        const size_t i = t->point[k];
        const float *column = s->jacobian + s->row[i] * s->n_columns,
                    *shift = column + fit_at_translation(p->n_params);
        fit_likelihood r;
        sdm_fit_likelihood(&p->observation, 0, NULL, s->field[i], true, &r);
        for (size_t a = 0; a < 3; a++)
            t->place[3 * k + a] = s->world[3 * i + a] + s->field[i] * (double)shift[a];
        t->residual[k] = r.residual;
        for (size_t a = 0; a < n; a++) {
            t->root[k * n + a] = r.root[0] * (double)column[a];
            t->model[k * n + a] = r.complete[0] * (double)column[a];
        }
    }
    return status;
}

static double distance(const subset *t, size_t i, size_t j)
{
    return sqrt(v3_dist2(t->place + 3 * i, t->place + 3 * j));
}

/* Sums over the pairs of the subset, by bins of their distance. */
typedef struct pairs {
    double number[BINS], product[BINS];
} pairs;

static void pairs_count(const fit_problem *p, const subset *t, double width, pairs *out)
{
    pairs part[FIT_SLICES] = {{{0}, {0}}};
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = t->n * slice / FIT_SLICES; i < t->n * (slice + 1) / FIT_SLICES; i++)
            for (size_t j = 0; j < i; j++) {
                const double bin = distance(t, i, j) / width;
                if (!(bin < BINS)) continue;
                part[slice].number[(size_t)bin]++;
                part[slice].product[(size_t)bin] += t->residual[i] * t->residual[j];
            }
    *out = (pairs){{0}, {0}};
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t k = 0; k < BINS; k++) {
            out->number[k] += part[slice].number[k];
            out->product[k] += part[slice].product[k];
        }
}

/* The correlation c0 (1 - d / radius)^2; radius = 0: the points are independent. */
typedef struct kernel {
    double c0, radius;
} kernel;

static double kernel_at(const kernel *k, double d)
{
    const double way = d < k->radius ? 1 - d / k->radius : 0;
    return k->c0 * way * way;
}

static kernel kernel_fit(const pairs *bins, double width, double variance)
{
    double product = 0;
    size_t end = 0;
    for (size_t k = 0; k < BINS; k++) {
        if (!(bins->number[k] > 0)) continue;
        const double c = bins->product[k] / (bins->number[k] * variance);
        if (!(c > fmax(CORRELATION_MIN, 2 / sqrt(bins->number[k])))) break;
        product += bins->product[k] / variance;
        end = k + 1;
    }
    kernel out = {.c0 = 0, .radius = 0};
    if (!end) return out;
    // the least radius from `end` on with a c0 of at most 1
    for (out.radius = width * (double)end;; out.radius *= 1.1) {
        double sum = 0;
        out.c0 = 1;
        for (size_t k = 0; k < BINS; k++)
            sum += bins->number[k] * kernel_at(&out, width * ((double)k + 0.5));
        out.c0 = sum > 0 ? product / sum : INFINITY;
        if (out.c0 <= 1 || out.radius > 2 * BINS * width) break;
    }
    out.c0 = fmin(out.c0, 1);
    return out;
}

// out += scale^2 * sum over pairs i != j of kernel(d_ij) x_i x_j^T, and scale * sum over i of x_i
// x_i^T; *factor: mean over i of the sum over all points j of the kernel, that of the point itself
// taken as 1
static sdm_status products_add(const fit_problem *p, const subset *t, const double *x,
                               const kernel *c, double *out, double *factor, sdm_error *err)
{
    const size_t n = p->information.n_unknowns, size = n * n + 1;
    double *parts = NULL;
    const sdm_status s = SDM_ALLOC(&parts, FIT_SLICES * size, "covariance of the score", err);
    if (s) return s;
    const int n_threads = sdm_threads(p->opts->n_threads);
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = t->n * slice / FIT_SLICES; i < t->n * (slice + 1) / FIT_SLICES; i++) {
            double *part = parts + slice * size, around[FIT_UNKNOWNS_MAX], sum = 1;
            for (size_t a = 0; a < n; a++) around[a] = x[i * n + a];
            for (size_t j = 0; j < t->n && c->radius > 0; j++) {
                const double w = i == j ? 0 : t->scale * kernel_at(c, distance(t, i, j));
                if (!(w > 0)) continue;
                sum += w;
                for (size_t a = 0; a < n; a++) around[a] += w * x[j * n + a];
            }
            for (size_t a = 0; a < n; a++)
                for (size_t b = 0; b < n; b++) part[a * n + b] += x[i * n + a] * around[b];
            part[n * n] += sum;
        }
    for (size_t slice = 1; slice < FIT_SLICES; slice++)
        for (size_t k = 0; k < size; k++) parts[k] += parts[slice * size + k];
    for (size_t a = 0; a < n; a++)
        for (size_t b = 0; b < n; b++) // symmetric to the last bit
            out[a * n + b] += 0.5 * t->scale * (parts[a * n + b] + parts[b * n + a]);
    *factor = parts[n * n] / (double)t->n;
    sdm_free(parts);
    return SDM_OK;
}

sdm_status sdm_fit_point_covariance(const fit_problem *p, double model_mm, bool rough,
                                    double *noise, double *model, double *noise_factor,
                                    sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    const double *h = p->maps.grid.spacing, width = fmax(h[0], fmax(h[1], h[2]));
    subset t = {0};
    sdm_status s = subset_choose(p, rough ? POINTS_ROUGH : POINTS_MAX, &t, err);
    if (!s) {
        double variance = 0;
        for (size_t i = 0; i < t.n; i++) variance += t.residual[i] * t.residual[i] / (double)t.n;
        kernel c = {.c0 = 0, .radius = 0};
        if (variance > 0) {
            pairs bins;
            pairs_count(p, &t, width, &bins);
            c = kernel_fit(&bins, width, variance);
        }
        s = products_add(p, &t, t.root, &c, noise, noise_factor, err);
        for (size_t i = 0; i < n * n; i++) noise[i] *= variance;
    }
    if (!s && model_mm > 0) {
        const kernel of_map = {.c0 = 1, .radius = KERNEL_OVER_CUBE * model_mm};
        double ignored;
        s = products_add(p, &t, t.model, &of_map, model, &ignored, err);
    }
    subset_dispose(&t);
    return s;
}
