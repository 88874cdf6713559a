/* Residuals are e^ = (I - P) e, P = X A X^T with the roots X of the score and the influence A. With
   Omega the correlation of e

       E[e^ e^T] = Omega - P Omega - Omega P + P Omega P

   whose mean over the pairs of a lag is less than C(lag). What is missing is added: the first terms
   of a series (Neumann), as Omega is made of C itself. */
#include "correlation.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

// sums over pairs begin at so many of the voxels: of a correlation, of what the fit has taken
#define PAIRS_OF_LAG 8000
#define TAKEN_OF 800
// terms of the series
#define ROUNDS 4

// weighted mean of e_n e_(n+lag)
static double correlation_at(const fit_shell *v, const uint32_t *list, size_t n, const int lag[3])
{
    double sum = 0, weight = 0;
    for (size_t k = 0; k < n; k++) {
        const size_t i = list[k], j = sdm_fit_neighbour(v, i, lag, 1);
        if (j == SIZE_MAX) continue;
        const double w = (double)v->weight[i] * (double)v->weight[j];
        sum += w * (double)v->residual[i] * (double)v->residual[j];
        weight += w;
    }
    return weight > 0 ? sum / weight : 0;
}

// ring by ring of lags; the window is twice as wide as the last ring before the first whose sum
// does not stand out
sdm_status sdm_fit_correlate(const fit_shell *v, double effort, int n_threads, double *c,
                             int *width, sdm_error *err)
{
    uint32_t *list = NULL;
    size_t n;
    const sdm_status s = sdm_fit_shell_pick(v, effort * PAIRS_OF_LAG, &list, &n, err);
    (void)n_threads; // without OpenMP
    *width = FIT_LAG_MOST;
    memset(c, 0, (FIT_LAG_MIDDLE + 1) * sizeof *c);
    for (int k = 0; k <= *width && !s; k++) {
#pragma omp parallel for schedule(dynamic, 64) num_threads(n_threads)
        for (int number = 0; number <= FIT_LAG_MIDDLE; number++) {
            int lag[3];
            sdm_fit_lag_of(number, lag);
            if (sdm_fit_lag_size(lag) == k) c[number] = correlation_at(v, list, n, lag);
        }
        double sum = 0, lags = 0;
        for (int number = 0; number <= FIT_LAG_MIDDLE; number++) {
            int lag[3];
            sdm_fit_lag_of(number, lag);
            if (sdm_fit_lag_size(lag) == k) sum += c[number], lags++;
        }
        // standard error of the sum where nothing is correlated (Bartlett 1946)
        const double error = sqrt(lags / fmin((double)v->n, effort * PAIRS_OF_LAG));
        if (*width == FIT_LAG_MOST && k > 0 && !(sum > fmax(0.05, 2 * error) * c[FIT_LAG_MIDDLE]))
            *width = 2 * (k - 1) < FIT_LAG_MOST ? 2 * (k - 1) : FIT_LAG_MOST - 1;
    }
    sdm_free(list);
    return s;
}

// weight of a lag in a window
static double taper(const int lag[3], int width, bool flat)
{
    double w = 1;
    for (int a = 0; a < 3; a++) {
        const double share = fabs((double)lag[a]) / (double)(width + 1);
        w *= flat ? fmin(fmax(2 - 2 * share, 0), 1) : fmax(1 - share, 0);
    }
    return w;
}

double sdm_fit_weigh_lags(const double *c, int width, bool flat, double *weighted)
{
    double sum = c[FIT_LAG_MIDDLE];
    for (int number = 0; number <= FIT_LAG_MIDDLE; number++) {
        int lag[3];
        sdm_fit_lag_of(number, lag);
        weighted[number] = c[number] * taper(lag, width, flat);
        if (number < FIT_LAG_MIDDLE) sum += 2 * weighted[number];
    }
    return fmax(sum, c[FIT_LAG_MIDDLE]);
}

/* What is worked with: voxels where sums begin, and for each q = 2 A (Omega X) - V x, with the
 * covariance V = A X^T Omega X A. */
typedef struct taken {
    size_t n, n_unknowns;
    uint32_t *voxel;                    // [n]
    double *q;                          // [n][n_unknowns]
    double *around;                     // [n][n_unknowns] Omega X
    double *scatter, *product, *spread; // [n_unknowns][n_unknowns]
} taken;

static void dispose(taken *t)
{
    sdm_free(t->voxel);
    sdm_free(t->q);
    sdm_free(t->around);
    sdm_free(t->scatter);
    sdm_free(t->product);
    sdm_free(t->spread);
}

static sdm_status create(const fit_shell *v, taken *t, sdm_error *err)
{
    *t = (taken){.n_unknowns = v->n_unknowns};
    sdm_status s = sdm_fit_shell_pick(v, TAKEN_OF, &t->voxel, &t->n, err);
    const size_t square = v->n_unknowns * v->n_unknowns;
    if (!s) s = SDM_ALLOC(&t->q, t->n * v->n_unknowns, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->around, t->n * v->n_unknowns, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->scatter, square, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->product, square, "correlation of residuals", err);
    if (!s) s = SDM_ALLOC(&t->spread, square, "correlation of residuals", err);
    return s;
}

// Omega X at the voxels
static void look_around(const fit_shell *v, const double *weighted, int width, int n_threads,
                        taken *t)
{
    const size_t n = v->n_unknowns;
    (void)n_threads; // without OpenMP
#pragma omp parallel for schedule(dynamic, 16) num_threads(n_threads)
    for (size_t s = 0; s < t->n; s++) {
        double *around = t->around + s * n;
        memset(around, 0, n * sizeof *around);
        for (int number = 0; number <= FIT_LAG_MIDDLE; number++) {
            int lag[3];
            sdm_fit_lag_of(number, lag);
            if (sdm_fit_lag_size(lag) > width) continue;
            for (int sign = -1; sign <= (number == FIT_LAG_MIDDLE ? -1 : 1); sign += 2) {
                const size_t j = sdm_fit_neighbour(v, t->voxel[s], lag, sign);
                if (j == SIZE_MAX) continue;
                for (size_t a = 0; a < n; a++)
                    around[a] += weighted[number] * (double)v->root[j * n + a];
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

static void find_q(const fit_shell *v, const double *influence, taken *t)
{
    const size_t n = v->n_unknowns;
    const double scale = 0.5 * (double)v->n / (double)t->n;
    memset(t->scatter, 0, n * n * sizeof *t->scatter);
    for (size_t s = 0; s < t->n; s++)
        for (size_t a = 0; a < n; a++)
            for (size_t b = 0; b < n; b++) {
                const double x =
                    scale * (double)v->root[t->voxel[s] * n + a] * t->around[s * n + b];
                t->scatter[a * n + b] += x;
                t->scatter[b * n + a] += x;
            }
    multiply(n, influence, t->scatter, t->product);
    multiply(n, t->product, influence, t->spread);
    for (size_t s = 0; s < t->n; s++)
        for (size_t a = 0; a < n; a++) {
            double sum = 0;
            for (size_t b = 0; b < n; b++)
                sum += 2 * influence[a * n + b] * t->around[s * n + b] -
                       t->spread[a * n + b] * (double)v->root[t->voxel[s] * n + b];
            t->q[s * n + a] = sum;
        }
}

// weighted mean over the pairs of a lag of what the fit has taken
static double taken_at(const fit_shell *v, const taken *t, const int lag[3])
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

sdm_status sdm_fit_free_correlation(const fit_shell *v, const double *influence, int width,
                                    int n_threads, double *c, sdm_error *err)
{
    double found[FIT_LAG_MIDDLE + 1], weighted[FIT_LAG_MIDDLE + 1];
    taken t;
    const sdm_status s = create(v, &t, err);
    memcpy(found, c, sizeof found);
    for (int round = 0; round < ROUNDS && t.n && !s; round++) {
        (void)sdm_fit_weigh_lags(c, width, true, weighted);
        look_around(v, weighted, width, n_threads, &t);
        find_q(v, influence, &t);
#pragma omp parallel for schedule(dynamic, 64) num_threads(n_threads)
        for (int number = 0; number <= FIT_LAG_MIDDLE; number++) {
            int lag[3];
            sdm_fit_lag_of(number, lag);
            if (sdm_fit_lag_size(lag) <= width) c[number] = found[number] + taken_at(v, &t, lag);
        }
    }
    dispose(&t);
    return s;
}
