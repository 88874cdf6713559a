/* Score covariance.

   The score is the sum over voxels of residual e_n * root_n. With the autocorrelation
   C(lag) = E[e_n e_(n+lag)], estimated from the residuals of the inner band,

       cov(score) = sum over n and lags of C(lag) root_n root_(n+lag)^T

   (Conley 1999; here the e_n form one stationary field). Lags are tapered by a window: 1 in its
   inner half, then linear to 0 (Politis and Romano 1995). If the result is not positive definite,
   the window falls linearly from lag zero (Bartlett 1950), which makes it so unless the corrected
   correlations differ much from those of the residuals. */
#include "score_covariance.h"

#include <math.h>
#include <string.h>

#include "correlation.h"
#include "fit/solver/prior.h"
#include "fit/solver/solve.h"
#include "label_steps.h"
#include "point_covariance.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

// limit on the number of voxel pairs: the sum over n runs over a subsample of the voxels that gives
// about this number
#define PAIRS 30000000
// least degrees of freedom of the correlations
#define FREEDOM_MIN 6.0
// part of PAIRS for a rough estimate
#define ROUGH 0.2

/* out += sum over voxels and both halves of the lags of c(lag) root_n root_(n+lag)^T. Computed in
 * slices of the voxels, which are added in order. */
static sdm_status products_add(const fit_neighbours *v, const double *c, double effort, int width,
                               int n_threads, double *out, sdm_error *err)
{
    const size_t n = v->n_unknowns;
    const float *x = v->root;
    double *parts = NULL;
    const sdm_status s = SDM_ALLOC(&parts, FIT_SLICES * n * n, "covariance of the score", err);
    if (s) return s;
    (void)n_threads; // unused without OpenMP
    // subsample of the voxels that the sum over n uses
    const float threshold =
        sdm_fit_neighbours_threshold(v, effort * PAIRS / (pow(2.0 * width + 1, 3) / 2 + 1));
    size_t chosen = 0;
    for (size_t i = 0; i < v->n; i++) chosen += v->draw[i] <= threshold;
    const double scale = (double)v->n / fmax((double)chosen, 1);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t i = v->n * slice / FIT_SLICES; i < v->n * (slice + 1) / FIT_SLICES; i++) {
            if (v->draw[i] > threshold) continue;
            // correlation-weighted sum of the roots of the neighbours
            float around[FIT_UNKNOWNS_MAX] = {0};
            double *part = parts + slice * n * n;
            for (int number = 0; number <= FIT_LAG_ZERO; number++) {
                int lag[3];
                sdm_fit_lag_vector(number, lag);
                if (c[number] == 0 || sdm_fit_lag_length(lag) > width) continue;
                const size_t j = sdm_fit_neighbour(v, i, lag, 1);
                if (j == SIZE_MAX) continue;
                const float w = (float)(number == FIT_LAG_ZERO ? 0.5 * c[number] : c[number]);
                for (size_t a = 0; a < n; a++) around[a] += w * x[j * n + a];
            }
            // times the root of the voxel
            for (size_t a = 0; a < n; a++)
                for (size_t b = 0; b < n; b++)
                    part[a * n + b] += (double)x[i * n + a] * (double)around[b];
        }
    // sum of the slices, and its transpose for the other half of the lags
    for (size_t slice = 0; slice < FIT_SLICES; slice++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++)
                out[a * n + b] +=
                    scale * (parts[slice * n * n + a * n + b] + parts[slice * n * n + b * n + a]);
    sdm_free(parts);
    return SDM_OK;
}

// adds the samples outside the inner band, of which only the scores by the tissue means count;
// factor: sum of the correlations
static void far_add(const fit_problem *p, double factor, double *out)
{
    const size_t n = p->information.n_unknowns, nc = p->samples.n_columns;
    for (size_t i = 0; i < p->samples.n && p->observation.n_channels > 1; i++) {
        if (sdm_fit_in_inner_band(p, i)) continue;
        fit_likelihood r;
        sdm_fit_likelihood(&p->observation, (double)p->samples.value[i],
                           fit_sample_weights(&p->samples, i), p->samples.field[i], true, &r);
        for (size_t a = 1; a < p->observation.n_channels; a++)
            for (size_t b = 1; b < p->observation.n_channels; b++)
                out[(nc + a - 1) * n + nc + b - 1] += factor * r.root[a] * r.root[b];
    }
}

// covariance caused by noise. definite: uses the narrower window if the flat one gives a matrix
// that is not positive definite
static sdm_status noise_add(const fit_problem *p, const fit_neighbours *v, const double *c,
                            int width, int n_threads, bool definite, fit_score_covariance *out,
                            sdm_error *err)
{
    const size_t n = v->n_unknowns;
    double tapered[FIT_LAG_ZERO + 1], *work = NULL, scale[FIT_UNKNOWNS_MAX];
    sdm_status s = SDM_ALLOC(&work, 2 * n * n, "covariance of the score", err);
    for (int flat = 1; flat >= 0 && !s; flat--) {
        const double sum = sdm_fit_correlation_taper(c, width, flat, tapered);
        memset(out->noise, 0, n * n * sizeof *out->noise);
        s = products_add(v, tapered, definite ? 1 : ROUGH, width, n_threads, out->noise, err);
        far_add(p, sum, out->noise);
        memcpy(work, out->noise, n * n * sizeof *work);
        sdm_fit_add_weak_prior(p, work);
        for (size_t i = 0; i < n; i++)
            if (!(work[i * (n + 1)] > 0)) work[i * (n + 1)] = 1; // the blur, where it is no unknown
        if (!definite || sdm_fit_cholesky(n, work, work + n * n, scale)) break;
    }
    sdm_free(work);
    return s;
}

// The correlations are estimated, too: with `freedom` degrees of freedom an error follows Student's
// t, whose variance is larger by freedom / (freedom - 2).
static void noise_widen(double *noise, size_t n, double freedom)
{
    const double most = fmax(freedom, FREEDOM_MIN);
    for (size_t i = 0; i < n * n; i++) noise[i] *= most / (most - 2);
}

// adds the covariance caused by map errors that are constant within cubes of this edge (mm) and
// independent between cubes
static sdm_status model_error_add(const fit_problem *p, const fit_neighbours *v, double edge,
                                  double *out, sdm_error *err)
{
    const size_t n = v->n_unknowns;
    // cubes: edge in steps, and their number along each axis
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
    // score caused by a map error of 1 mm in each cube
    for (size_t i = 0; i < v->n; i++) {
        int64_t k[3];
        for (size_t a = 0; a < 3; a++) k[a] = v->position[3 * i + a] / steps[a];
        double *of_cube = sum + (size_t)((k[2] * count[1] + k[1]) * count[0] + k[0]) * n;
        for (size_t a = 0; a < n; a++) of_cube[a] += (double)v->model_score[i * n + a];
    }
    for (size_t cube = 0; cube < cubes; cube++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) out[a * n + b] += sum[cube * n + a] * sum[cube * n + b];
    sdm_free(sum);
    return SDM_OK;
}

// score covariance of images and label maps
static sdm_status voxels_covariance(const fit_problem *p, double model_mm, const double *influence,
                                    fit_score_covariance *out, sdm_error *err)
{
    fit_neighbours v;
    sdm_status s = sdm_fit_neighbours_create(p, &v, err);
    double c[FIT_LAG_ZERO + 1];
    const int n_threads = sdm_threads(p->opts->n_threads);
    if (!s) {
        int width;
        double freedom;
        s = sdm_fit_correlation_estimate(&v, influence ? 1 : ROUGH, n_threads, c, &width, &freedom,
                                         err);
        double tapered[FIT_LAG_ZERO + 1];
        if (!s) out->noise_factor = sdm_fit_correlation_taper(c, width, true, tapered);
        if (!s && influence)
            s = sdm_fit_correlation_correct(&v, influence, width, n_threads, c, err);
        if (!s) s = noise_add(p, &v, c, width, n_threads, influence, out, err);
        if (!s && influence && !p->given_labels) noise_widen(out->noise, v.n_unknowns, freedom);
    }
    if (!s && model_mm > 0) s = model_error_add(p, &v, model_mm, out->model, err);
    if (!s && influence && p->given_labels) s = sdm_fit_label_steps(p, &v, out->noise, err);
    sdm_fit_neighbours_dispose(&v);
    return s;
}

sdm_status sdm_fit_score_covariance_create(const fit_problem *p, double model_mm,
                                           const double *influence, fit_score_covariance *out,
                                           sdm_error *err)
{
    const size_t n = p->information.n_unknowns;
    *out = (fit_score_covariance){.noise_factor = 1};
    sdm_status s = SDM_ALLOC(&out->noise, n * n, "covariance of the score", err);
    if (!s) s = SDM_ALLOC(&out->model, n * n, "covariance of the score", err);
    if (!s && p->target->kind == SDM_FIT_POINTS)
        s = sdm_fit_point_covariance(p, model_mm, !influence, out->noise, out->model,
                                     &out->noise_factor, err);
    else if (!s && sdm_fit_inner_band_count(p))
        s = voxels_covariance(p, model_mm, influence, out, err);
    if (s) sdm_fit_score_covariance_dispose(out);
    return s;
}

void sdm_fit_score_covariance_dispose(fit_score_covariance *s)
{
    sdm_free(s->noise);
    sdm_free(s->model);
    *s = (fit_score_covariance){0};
}
