/* Autocorrelation of the residuals, and its correction for the fit.

   The residuals are e' = (I - P) e with the errors e and the projection P = X A X^T. Row n of X is
   the root x_n of voxel n (its score is e_n x_n); A is the influence, the inverse of the
   information. With the covariance Omega of e

       E[e' e'^T] = Omega - P Omega - Omega P + P Omega P

   The mean over the pairs of a lag is therefore smaller than C(lag). The correction adds the
   missing terms. The elements of Omega are values of C itself, so the correction is iterated: the
   first terms of a Neumann series. */
#include "correlation.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

// voxels of the subsample for the mean over a lag, and for the correction by the fit
#define LAG_VOXELS 8000
#define BIAS_VOXELS 800
// terms of the Neumann series
#define NEUMANN_TERMS 4
// lags that are computed together: three rows of lags
enum { LAG_GROUP = 3 * FIT_LAGS };

/* Lags with consecutive numbers, whose correlations are computed together: the neighbours of a
 * voxel at these lags lie close together in memory. */
typedef struct lag_group {
    size_t n;
    int lag[LAG_GROUP][3], number[LAG_GROUP];
    /* weighted sum of e_n e_(n+lag) and e_n e_(n-lag) over a subsample, and sum of the weights */
    double sum[LAG_GROUP], weight[LAG_GROUP];
} lag_group;

// the lags of length k among LAG_GROUP numbers from `first` on, up to zero
static void group_choose(int first, int k, lag_group *g)
{
    g->n = 0;
    for (int number = first; number < first + LAG_GROUP && number <= FIT_LAG_ZERO; number++) {
        sdm_fit_lag_vector(number, g->lag[g->n]);
        g->number[g->n] = number;
        g->n += sdm_fit_lag_length(g->lag[g->n]) == k;
    }
}

// c[number]: weighted mean of e_n e_(n+lag) and e_n e_(n-lag) over the voxels list[n];
// present[number]: sum of the weights
static void group_means(const fit_neighbours *v, const uint32_t *list, size_t n, lag_group *g,
                        double *c, double *present)
{
    for (size_t l = 0; l < g->n; l++) g->sum[l] = g->weight[l] = 0;
    for (size_t k = 0; k < n; k++)
        for (size_t l = 0; l < g->n; l++)
            for (int sign = -1; sign <= 1; sign += 2) {
                const size_t i = list[k], j = sdm_fit_neighbour(v, i, g->lag[l], sign);
                if (j == SIZE_MAX) continue;
                const double w = (double)v->weight[i] * (double)v->weight[j];
                g->sum[l] += w * (double)v->residual[i] * (double)v->residual[j];
                g->weight[l] += w;
            }
    for (size_t l = 0; l < g->n; l++) {
        c[g->number[l]] = g->weight[l] > 0 ? g->sum[l] / g->weight[l] : 0;
        present[g->number[l]] = g->weight[l];
    }
}

// weight of a lag in the window
static double lag_taper(const int lag[3], int width, bool flat)
{
    double w = 1;
    for (int a = 0; a < 3; a++) {
        const double fraction = fabs((double)lag[a]) / (double)(width + 1);
        w *= flat ? fmin(fmax(2 - 2 * fraction, 0), 1) : fmax(1 - fraction, 0);
    }
    return w;
}

// sum over all lags of the squared weights in the flat window, times the part of the voxels that
// has a neighbour there
static double window_size(const double *present, int width)
{
    double sum = 1;
    for (int number = 0; number < FIT_LAG_ZERO && present[FIT_LAG_ZERO] > 0; number++) {
        int lag[3];
        sdm_fit_lag_vector(number, lag);
        const double w = sdm_fit_lag_length(lag) > width ? 0 : lag_taper(lag, width, true);
        sum += 2 * w * w * present[number] / present[FIT_LAG_ZERO];
    }
    return sum;
}

/* Shells of lags of the same length, outwards. The half width of the window is twice the length of
 * the last shell before the first one whose sum does not exceed its standard error. */
sdm_status sdm_fit_correlation_estimate(const fit_neighbours *v, double effort, int n_threads,
                                        double *c, int *width, double *freedom, sdm_error *err)
{
    uint32_t *list = NULL;
    size_t n;
    double present[FIT_LAG_ZERO + 1] = {0};
    const sdm_status s = sdm_fit_neighbours_pick(v, effort * LAG_VOXELS, &list, &n, err);
    (void)n_threads; // unused without OpenMP
    *width = FIT_LAG_MAX;
    memset(c, 0, (FIT_LAG_ZERO + 1) * sizeof *c);
    for (int k = 0; k <= *width && !s; k++) {
        // shell k: correlations, and their sum
#pragma omp parallel for schedule(dynamic) num_threads(n_threads)
        for (int first = 0; first <= FIT_LAG_ZERO; first += LAG_GROUP) {
            lag_group g;
            group_choose(first, k, &g);
            group_means(v, list, n, &g, c, present);
        }
        double sum = 0, lags = 0;
        for (int number = 0; number <= FIT_LAG_ZERO; number++) {
            int lag[3];
            sdm_fit_lag_vector(number, lag);
            if (sdm_fit_lag_length(lag) == k) sum += c[number], lags++;
        }
        // the first shell that does not exceed the standard error of uncorrelated data (Bartlett
        // 1946) sets the width
        const double error = sqrt(lags / fmin((double)v->n, effort * LAG_VOXELS));
        if (*width == FIT_LAG_MAX && k > 0 && !(sum > fmax(0.05, 2 * error) * c[FIT_LAG_ZERO]))
            *width = 2 * (k - 1) < FIT_LAG_MAX ? 2 * (k - 1) : FIT_LAG_MAX - 1;
    }
    sdm_free(list);
    *freedom = s ? 0 : (double)n / window_size(present, *width);
    return s;
}

double sdm_fit_correlation_taper(const double *c, int width, bool flat, double *tapered)
{
    double sum = c[FIT_LAG_ZERO];
    for (int number = 0; number <= FIT_LAG_ZERO; number++) {
        int lag[3];
        sdm_fit_lag_vector(number, lag);
        tapered[number] = c[number] * lag_taper(lag, width, flat);
        if (number < FIT_LAG_ZERO) sum += 2 * tapered[number];
    }
    return fmax(sum, c[FIT_LAG_ZERO]);
}

/* Scratch memory of the correction. Notation as at the top of the file. */
typedef struct fit_bias {
    size_t n, n_unknowns;
    /* [n] subsample of the voxels */
    uint32_t *voxel;
    /* [n][n_unknowns] q_i = 2 A (Omega X)_i - V x_i; the correction of a pair i, j is q_i . x_j */
    double *q;
    /* [n][n_unknowns] rows of Omega X */
    double *around;
    /* [n_unknowns][n_unknowns] X^T Omega X, A X^T Omega X, V = A X^T Omega X A */
    double *score_covariance, *product, *covariance;
} fit_bias;

static void bias_dispose(fit_bias *t)
{
    sdm_free(t->voxel);
    sdm_free(t->q);
    sdm_free(t->around);
    sdm_free(t->score_covariance);
    sdm_free(t->product);
    sdm_free(t->covariance);
}

static sdm_status bias_create(const fit_neighbours *v, fit_bias *t, sdm_error *err)
{
    *t = (fit_bias){.n_unknowns = v->n_unknowns};
    sdm_status s = sdm_fit_neighbours_pick(v, BIAS_VOXELS, &t->voxel, &t->n, err);
    const size_t square = v->n_unknowns * v->n_unknowns;
    if (!s) s = SDM_ALLOC(&t->q, t->n * v->n_unknowns, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->around, t->n * v->n_unknowns, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->score_covariance, square, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->product, square, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->covariance, square, "correlation of residuals", err);
    return s;
}

// t->around = Omega X: for each voxel the sum over its neighbours n of correlation * row n of X,
// where row n of X is the root x_n of voxel n (its score is e_n x_n)
static void bias_neighbour_sums(const fit_neighbours *v, const double *tapered, int width,
                                int n_threads, fit_bias *t)
{
    const size_t n = v->n_unknowns;
    (void)n_threads; // unused without OpenMP
#pragma omp parallel for schedule(dynamic, 16) num_threads(n_threads)
    for (size_t s = 0; s < t->n; s++) {
        double *around = t->around + s * n;
        memset(around, 0, n * sizeof *around);
        for (int number = 0; number <= FIT_LAG_ZERO; number++) {
            int lag[3];
            sdm_fit_lag_vector(number, lag);
            if (sdm_fit_lag_length(lag) > width) continue;
            for (int sign = -1; sign <= (number == FIT_LAG_ZERO ? -1 : 1); sign += 2) {
                const size_t j = sdm_fit_neighbour(v, t->voxel[s], lag, sign);
                if (j == SIZE_MAX) continue;
                for (size_t a = 0; a < n; a++)
                    around[a] += tapered[number] * (double)v->root[j * n + a];
            }
        }
    }
}

// out = a b, all [n][n]
static void multiply(size_t n, const double *a, const double *b, double *out)
{
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++) {
            double sum = 0;
            for (size_t k = 0; k < n; k++) sum += a[i * n + k] * b[k * n + j];
            out[i * n + j] = sum;
        }
}

// computes X^T Omega X from the subsample, then V and q
static void bias_vectors(const fit_neighbours *v, const double *influence, fit_bias *t)
{
    const size_t n = v->n_unknowns;
    const double scale = 0.5 * (double)v->n / (double)t->n;
    memset(t->score_covariance, 0, n * n * sizeof *t->score_covariance);
    for (size_t s = 0; s < t->n; s++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) {
                const double x =
                    scale * (double)v->root[t->voxel[s] * n + a] * t->around[s * n + b];
                t->score_covariance[a * n + b] += x;
                t->score_covariance[b * n + a] += x;
            }
    multiply(n, influence, t->score_covariance, t->product);
    multiply(n, t->product, influence, t->covariance);
    for (size_t s = 0; s < t->n; s++)
        for (size_t a = 0; a < n; a++) {
            double sum = 0;
            for (size_t b = 0; b < n; b++)
                sum += 2 * influence[a * n + b] * t->around[s * n + b] -
                       t->covariance[a * n + b] * (double)v->root[t->voxel[s] * n + b];
            t->q[s * n + a] = sum;
        }
}

// what the fit has removed from C(lag): the weighted mean of q_i . x_j over the pairs i, j at this
// lag
static double bias_at(const fit_neighbours *v, const fit_bias *t, const int lag[3])
{
    const size_t n = v->n_unknowns;
    double sum = 0, weight = 0;
    for (size_t s = 0; s < t->n; s++)
        for (int sign = -1; sign <= 1; sign += 2) {
            const size_t i = t->voxel[s], j = sdm_fit_neighbour(v, i, lag, sign);
            if (j == SIZE_MAX) continue;
            const double w = (double)v->weight[i] * (double)v->weight[j];
            double product = 0;
            for (size_t a = 0; a < n; a++) product += t->q[s * n + a] * (double)v->root[j * n + a];
            sum += w * product;
            weight += w;
        }
    return weight > 0 ? sum / weight : 0;
}

sdm_status sdm_fit_correlation_correct(const fit_neighbours *v, const double *influence, int width,
                                       int n_threads, double *c, sdm_error *err)
{
    double found[FIT_LAG_ZERO + 1], tapered[FIT_LAG_ZERO + 1];
    fit_bias t;
    const sdm_status s = bias_create(v, &t, err);
    memcpy(found, c, sizeof found);
    for (int round = 0; round < NEUMANN_TERMS && t.n && !s; round++) {
        (void)sdm_fit_correlation_taper(c, width, true, tapered);
        bias_neighbour_sums(v, tapered, width, n_threads, &t);
        bias_vectors(v, influence, &t);
#pragma omp parallel for schedule(dynamic, 64) num_threads(n_threads)
        for (int number = 0; number <= FIT_LAG_ZERO; number++) {
            int lag[3];
            sdm_fit_lag_vector(number, lag);
            if (sdm_fit_lag_length(lag) <= width) c[number] = found[number] + bias_at(v, &t, lag);
        }
    }
    bias_dispose(&t);
    return s;
}
