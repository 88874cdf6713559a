/* Anderson acceleration (1965). With residuals r_i = g(x_i) - x_i, it takes the affine combination
 * of the stored images g(x_i) whose combined residual has the least norm. For an affine g this is
 * the fixed point. */
#include "anderson.h"

#include <math.h>
#include <string.h>

#include "solve.h"

// A residual that grew by more than this factor since the last pair belongs to a different
// function: drop the older pairs.
#define GROWTH_MAX 2.0

static double residual(const fit_anderson *m, size_t pair, size_t k)
{
    return m->image[pair][k] - m->point[pair][k];
}

static double residual_norm(const fit_anderson *m, size_t pair, size_t n)
{
    double sum = 0;
    for (size_t k = 0; k < n; k++) sum += residual(m, pair, k) * residual(m, pair, k);
    return sqrt(sum);
}

// drops the oldest pairs
static void pairs_drop(fit_anderson *m, size_t dropped)
{
    m->count -= dropped;
    memmove(m->point, m->point + dropped, m->count * sizeof *m->point);
    memmove(m->image, m->image + dropped, m->count * sizeof *m->image);
}

// weight[count - 1]: weights of the differences between the newest pair and each older one, from
// the normal equations that minimise the combined residual; false: the equations are singular
static bool weights_solve(const fit_anderson *m, size_t n, double *weight)
{
    const size_t rest = m->count - 1;
    double a[FIT_ANDERSON_DEPTH * FIT_ANDERSON_DEPTH],
        factor[FIT_ANDERSON_DEPTH * FIT_ANDERSON_DEPTH], scale[FIT_ANDERSON_DEPTH];
    for (size_t i = 0; i < rest; i++) {
        weight[i] = 0;
        for (size_t j = 0; j < rest; j++) a[i * rest + j] = 0;
        for (size_t k = 0; k < n; k++) {
            const double newest = residual(m, rest, k), d = newest - residual(m, i, k);
            weight[i] += d * newest;
            for (size_t j = 0; j < rest; j++) a[i * rest + j] += d * (newest - residual(m, j, k));
        }
    }
    if (!sdm_fit_cholesky(rest, a, factor, scale)) return false;
    sdm_fit_solve(rest, factor, scale, weight);
    return true;
}

void sdm_fit_anderson_mix(fit_anderson *m, size_t depth, size_t n, const double *x, double *y,
                          double max_change)
{
    // store the pair; drop pairs that are too old, or too different to combine
    if (m->count > depth) pairs_drop(m, m->count - depth);
    memcpy(m->point[m->count], x, n * sizeof *x);
    memcpy(m->image[m->count++], y, n * sizeof *y);
    if (m->count > 1 &&
        !(residual_norm(m, m->count - 1, n) <= GROWTH_MAX * residual_norm(m, m->count - 2, n)))
        pairs_drop(m, m->count - 1);
    double weight[FIT_ANDERSON_DEPTH];
    while (m->count > 1 && !weights_solve(m, n, weight)) pairs_drop(m, 1);
    // add the weighted differences to the newest image, scaled down to the limit
    const size_t newest = m->count - 1;
    double change[FIT_ANDERSON_MAX], largest = 0;
    for (size_t k = 0; k < n; k++) {
        change[k] = 0;
        for (size_t i = 0; i < newest; i++)
            change[k] -= weight[i] * (m->image[newest][k] - m->image[i][k]);
        largest = fmax(largest, fabs(change[k]));
    }
    for (size_t k = 0; k < n; k++)
        y[k] += largest > max_change ? change[k] * (max_change / largest) : change[k];
}
