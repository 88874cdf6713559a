/* Cholesky factorisation, and steps within limits. */
#include "solve.h"

#include <float.h>
#include <math.h>
#include <string.h>

bool sdm_fit_cholesky(size_t n, const double *a, double *factor, double *scale)
{
    for (size_t i = 0; i < n; i++) {
        if (!(a[i * n + i] > 0)) return false;
        scale[i] = 1 / sqrt(a[i * n + i]);
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            double sum = a[i * n + j] * scale[i] * scale[j];
            for (size_t k = 0; k < j; k++) sum -= factor[i * n + k] * factor[j * n + k];
            if (i != j)
                factor[i * n + j] = sum / factor[j * n + j];
            else if (sum > 8 * (double)n * DBL_EPSILON) // positive beyond rounding
                factor[i * n + i] = sqrt(sum);
            else
                return false;
        }
    return true;
}

void sdm_fit_solve(size_t n, const double *factor, const double *scale, double *x)
{
    for (size_t i = 0; i < n; i++) {
        double sum = x[i] * scale[i];
        for (size_t k = 0; k < i; k++) sum -= factor[i * n + k] * x[k];
        x[i] = sum / factor[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        double sum = x[i];
        for (size_t k = i + 1; k < n; k++) sum -= factor[k * n + i] * x[k];
        x[i] = sum / factor[i * n + i];
    }
    for (size_t i = 0; i < n; i++) x[i] *= scale[i];
}

// rest[] = the unknowns that are not held; their number
static size_t free_ones(size_t n, const bool *held, size_t *rest)
{
    size_t m = 0;
    for (size_t i = 0; i < n; i++)
        if (!held[i]) rest[m++] = i;
    return m;
}

bool sdm_fit_inverse(size_t n, const double *a, const bool *held, double *inverse, double *work)
{
    size_t rest[FIT_UNKNOWNS_MAX];
    double scale[FIT_UNKNOWNS_MAX], *matrix = work, *factor = work + n * n;
    const size_t m = free_ones(n, held, rest);
    memset(inverse, 0, n * n * sizeof *inverse);
    for (size_t i = 0; i < m; i++)
        for (size_t j = 0; j < m; j++) matrix[i * m + j] = a[rest[i] * n + rest[j]];
    if (!sdm_fit_cholesky(m, matrix, factor, scale)) return false;
    for (size_t j = 0; j < m; j++) {
        double column[FIT_UNKNOWNS_MAX] = {0};
        column[j] = 1;
        sdm_fit_solve(m, factor, scale, column);
        for (size_t i = 0; i < m; i++) inverse[rest[i] * n + rest[j]] = column[i];
    }
    return true;
}

// solves for the unknowns that are not held, with the held ones at their values in step[n]
static bool free_step(size_t n, const double *a, const double *gradient, double damping,
                      const bool *held, double *step, double *work)
{
    size_t rest[FIT_UNKNOWNS_MAX];
    double x[FIT_UNKNOWNS_MAX], scale[FIT_UNKNOWNS_MAX], *matrix = work, *factor = work + n * n;
    const size_t m = free_ones(n, held, rest);
    for (size_t i = 0; i < m; i++) {
        x[i] = gradient[rest[i]];
        for (size_t k = 0; k < n; k++)
            if (held[k]) x[i] -= a[rest[i] * n + k] * step[k];
        for (size_t j = 0; j < m; j++)
            matrix[i * m + j] = a[rest[i] * n + rest[j]] * (i == j ? 1 + damping : 1);
    }
    if (!sdm_fit_cholesky(m, matrix, factor, scale)) return false;
    sdm_fit_solve(m, factor, scale, x);
    for (size_t i = 0; i < m; i++) step[rest[i]] = x[i];
    return true;
}

bool sdm_fit_bounded_step(size_t n, const double *a, const double *gradient, double damping,
                          const fit_limits *limits, double *step, double *work)
{
    bool held[FIT_UNKNOWNS_MAX];
    memcpy(held, limits->kept, n * sizeof *held);
    memset(step, 0, n * sizeof *step);
    for (size_t round = 0; round <= n; round++) {
        if (!free_step(n, a, gradient, damping, held, step, work)) return false;
        size_t beyond = n;
        double most = 0;
        // hold the unknown that is farthest beyond its limit, in sd
        for (size_t i = 0; i < n; i++) {
            if (held[i]) continue;
            const double over =
                fmax(limits->min[i] - step[i], step[i] - limits->max[i]) * sqrt(a[i * n + i]);
            if (over > most) most = over, beyond = i;
        }
        if (beyond == n) return true;
        step[beyond] = fmin(fmax(step[beyond], limits->min[beyond]), limits->max[beyond]);
        held[beyond] = true;
    }
    return true;
}
