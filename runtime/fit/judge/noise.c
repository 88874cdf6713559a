/* Medians, and the sizes and correlations of noise that follow from them. */
#include "noise.h"

#include <math.h>
#include <stdlib.h>

// sd of a Gaussian over its median of absolute deviations
#define SD_OF_MAD 1.4826022185056018
// fewest differences of which a correlation is computed
#define DIFFERENCES_MIN 30

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double sdm_fit_median(double *x, size_t n)
{
    if (!n) return NAN;
    qsort(x, n, sizeof *x, ascending);
    return 0.5 * (x[(n - 1) / 2] + x[n / 2]);
}

double sdm_fit_robust_sd(double *x, size_t n, double centre)
{
    for (size_t i = 0; i < n; i++) x[i] = fabs(x[i] - centre);
    return SD_OF_MAD * sdm_fit_median(x, n);
}

double sdm_fit_shortest_half(double *x, size_t n, double *sd)
{
    *sd = NAN;
    if (!n) return NAN;
    qsort(x, n, sizeof *x, ascending);
    const size_t half = n / 2;
    size_t best = 0;
    for (size_t i = 0; i + half < n; i++)
        if (x[i + half] - x[i] < x[best + half] - x[best]) best = i;
    *sd = 0.5 * SD_OF_MAD * (x[best + half] - x[best]);
    return 0.5 * (x[best + half] + x[best]);
}

double sdm_fit_robust_correlation(double *d, size_t n)
{
    if (n < DIFFERENCES_MIN) return NAN;
    const double sd = sdm_fit_robust_sd(d, n, 0);
    return fmin(fmax(1 - 0.5 * sd * sd, 0), 1);
}
