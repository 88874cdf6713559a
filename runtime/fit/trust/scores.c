/* score = sum over voxels of residual e_n * root_n. With C(lag) = E[e_n e_(n+lag)], estimated from
   the residuals near the surface,

       cov(score) = sum over n and lags of C(lag) root_n root_(n+lag)^T     (Conley 1999, here with
   the e of one stationary field)

   The weight of a lag is 1 in the inner half of a window and falls linearly to its edge (Politis
   and Romano 1995), or, should the sum not be positive definite so, falls linearly from the middle
   (Bartlett 1950), where it is but for freed correlations far from those found. */
#include "scores.h"

#include <math.h>
#include <string.h>

#include "correlation.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

// sums over neighbours begin at some of the voxels, so that there are about so many of them
#define PAIRS 30000000
// the part of them that serves where only weights are wanted
#define ROUGH 0.2

/* out += sum of c(lag) root_n root_(n+lag)^T over voxels and both halves of the lags. Slices of
 * voxels, added in order. */
static sdm_status add_products(const fit_shell *v, const double *c, double effort, int width,
                               int n_threads, double *out, sdm_error *err)
{
    const size_t n = v->n_unknowns;
    const float *x = v->root;
    double *parts = NULL;
    const sdm_status s = SDM_ALLOC(&parts, FIT_SLICES * n * n, "covariance of the score", err);
    if (s) return s;
    (void)n_threads; // without OpenMP
    const float share = sdm_fit_shell_share(v, effort * PAIRS / (pow(2.0 * width + 1, 3) / 2 + 1));
    size_t chosen = 0;
    for (size_t i = 0; i < v->n; i++) chosen += v->lot[i] <= share;
    const double scale = (double)v->n / fmax((double)chosen, 1);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = v->n * slice / FIT_SLICES; i < v->n * (slice + 1) / FIT_SLICES; i++) {
            if (v->lot[i] > share) continue;
            float around[FIT_UNKNOWNS_MAX] = {0};
            double *part = parts + slice * n * n;
            for (int number = 0; number <= FIT_LAG_MIDDLE; number++) {
                int lag[3];
                sdm_fit_lag_of(number, lag);
                if (c[number] == 0 || sdm_fit_lag_size(lag) > width) continue;
                const size_t j = sdm_fit_neighbour(v, i, lag, 1);
                if (j == SIZE_MAX) continue;
                const float w = (float)(number == FIT_LAG_MIDDLE ? 0.5 * c[number] : c[number]);
                for (size_t a = 0; a < n; a++) around[a] += w * x[j * n + a];
            }
            for (size_t a = 0; a < n; a++)
                for (size_t b = 0; b < n; b++)
                    part[a * n + b] += (double)x[i * n + a] * (double)around[b];
        }
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++)
                out[a * n + b] +=
                    scale * (parts[slice * n * n + a * n + b] + parts[slice * n * n + b * n + a]);
    sdm_free(parts);
    return SDM_OK;
}

// voxels far from the surface: they tell of the means of the tissues alone
static void add_far(const fit_problem *p, double factor, double *out)
{
    const size_t n = p->sums.n_unknowns, nc = p->sites.n_columns;
    for (size_t i = 0; i < p->sites.n && p->laws.n_channels > 1; i++) {
        if (sdm_fit_in_shell(p, i)) continue;
        fit_response r;
        sdm_fit_respond(&p->laws, (double)p->sites.value[i], fit_place(&p->sites, i),
                        p->sites.field[i], true, &r);
        for (size_t a = 1; a < p->laws.n_channels; a++)
            for (size_t b = 1; b < p->laws.n_channels; b++)
                out[(nc + a - 1) * n + nc + b - 1] += factor * r.root[a] * r.root[b];
    }
}

// points have no grid: each on its own (White 1980)
static void add_points(const fit_problem *p, double *out)
{
    const size_t n = p->sums.n_unknowns;
    for (size_t i = 0; i < p->sites.n; i++) {
        fit_response r;
        sdm_fit_respond(&p->laws, 0, NULL, p->sites.field[i], true, &r);
        const float *c = p->sites.columns + p->sites.slot[i] * n;
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++)
                out[a * n + b] += r.score[0] * r.score[0] * (double)c[a] * (double)c[b];
    }
}

static sdm_status add_noise(const fit_problem *p, const fit_shell *v, const double *c, int width,
                            int n_threads, bool definite, fit_scatter *out, sdm_error *err)
{
    const size_t n = v->n_unknowns;
    double weighted[FIT_LAG_MIDDLE + 1], *work = NULL, scale[FIT_UNKNOWNS_MAX];
    sdm_status s = SDM_ALLOC(&work, 2 * n * n, "covariance of the score", err);
    for (int flat = 1; flat >= 0 && !s; flat--) {
        const double sum = sdm_fit_weigh_lags(c, width, flat, weighted);
        memset(out->noise, 0, n * n * sizeof *out->noise);
        s = add_products(v, weighted, definite ? 1 : ROUGH, width, n_threads, out->noise, err);
        add_far(p, sum, out->noise);
        memcpy(work, out->noise, n * n * sizeof *work);
        sdm_fit_add_ignorance(p, work);
        for (size_t i = 0; i < n; i++)
            if (!(work[i * (n + 1)] > 0)) work[i * (n + 1)] = 1; // the blur, where there is none
        if (!definite || sdm_fit_factorise(n, work, work + n * n, scale)) break;
    }
    sdm_free(work);
    return s;
}

// an error of the map that is the same within cubes of this edge and independent between them
static sdm_status add_model(const fit_problem *p, const fit_shell *v, double edge, double *out,
                            sdm_error *err)
{
    const size_t n = v->n_unknowns;
    int64_t steps[3], count[3];
    for (int a = 0; a < 3; a++) {
        steps[a] =
            (int64_t)fmax(floor(edge / (p->target->grid.spacing[a] * (double)v->step) + 0.5), 1);
        count[a] = (v->size[a] - 1) / steps[a] + 1;
    }
    const size_t cubes = (size_t)count[0] * (size_t)count[1] * (size_t)count[2];
    double *sum = NULL;
    size_t size;
    sdm_status s = sdm_mul(cubes, n, &size, err);
    if (!s) s = SDM_ALLOC(&sum, size, "covariance of the score", err);
    if (s) return s;
    for (size_t i = 0; i < v->n; i++) {
        int64_t k[3];
        for (size_t a = 0; a < 3; a++) k[a] = v->place[3 * i + a] / steps[a];
        double *of_cube = sum + (size_t)((k[2] * count[1] + k[1]) * count[0] + k[0]) * n;
        for (size_t a = 0; a < n; a++) of_cube[a] += (double)v->push[i * n + a];
    }
    for (size_t cube = 0; cube < cubes; cube++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) out[a * n + b] += sum[cube * n + a] * sum[cube * n + b];
    sdm_free(sum);
    return SDM_OK;
}

static sdm_status of_voxels(const fit_problem *p, double model_mm, const double *influence,
                            fit_scatter *out, sdm_error *err)
{
    fit_shell v;
    sdm_status s = sdm_fit_shell_create(p, &v, err);
    double c[FIT_LAG_MIDDLE + 1];
    const int n_threads = sdm_threads(p->opts->n_threads);
    if (!s) {
        int width;
        s = sdm_fit_correlate(&v, influence ? 1 : ROUGH, n_threads, c, &width, err);
        double weighted[FIT_LAG_MIDDLE + 1];
        if (!s) out->noise_factor = sdm_fit_weigh_lags(c, width, true, weighted);
        if (!s && influence) s = sdm_fit_free_correlation(&v, influence, width, n_threads, c, err);
        if (!s) s = add_noise(p, &v, c, width, n_threads, influence, out, err);
    }
    if (!s && model_mm > 0) s = add_model(p, &v, model_mm, out->model, err);
    sdm_fit_shell_dispose(&v);
    return s;
}

sdm_status sdm_fit_scatter_create(const fit_problem *p, double model_mm, const double *influence,
                                  fit_scatter *out, sdm_error *err)
{
    const size_t n = p->sums.n_unknowns;
    *out = (fit_scatter){.noise_factor = 1};
    sdm_status s = SDM_ALLOC(&out->noise, n * n, "covariance of the score", err);
    if (!s) s = SDM_ALLOC(&out->model, n * n, "covariance of the score", err);
    if (!s && p->target->kind == SDM_FIT_POINTS)
        add_points(p, out->noise);
    else if (!s && sdm_fit_count_shell(p))
        s = of_voxels(p, model_mm, influence, out, err);
    if (s) sdm_fit_scatter_dispose(out);
    return s;
}

void sdm_fit_scatter_dispose(fit_scatter *s)
{
    sdm_free(s->noise);
    sdm_free(s->model);
    *s = (fit_scatter){0};
}
