/* Anderson's acceleration (1965): the combination of the last images whose residual, image - point,
   would be least if the map were affine. */
#include "anderson.h"

#include <math.h>
#include <string.h>

#include "solve.h"

// a residual so many times that of the pair before is another map: the history is dropped
#define GROWTH_MOST 2.0

static double residual(const fit_mixing *m, size_t pair, size_t k)
{
    return m->image[pair][k] - m->point[pair][k];
}

static double norm(const fit_mixing *m, size_t pair, size_t n)
{
    double sum = 0;
    for (size_t k = 0; k < n; k++) sum += residual(m, pair, k) * residual(m, pair, k);
    return sqrt(sum);
}

static void drop_oldest(fit_mixing *m, size_t dropped)
{
    m->count -= dropped;
    memmove(m->point, m->point + dropped, m->count * sizeof *m->point);
    memmove(m->image, m->image + dropped, m->count * sizeof *m->image);
}

// share[count - 1] of the differences to the older pairs; false: they are not independent
static bool find_shares(const fit_mixing *m, size_t n, double *share)
{
    const size_t rest = m->count - 1;
    double a[FIT_MIXING_DEPTH * FIT_MIXING_DEPTH], factor[FIT_MIXING_DEPTH * FIT_MIXING_DEPTH],
        scale[FIT_MIXING_DEPTH];
    for (size_t i = 0; i < rest; i++) {
        share[i] = 0;
        for (size_t j = 0; j < rest; j++) a[i * rest + j] = 0;
        for (size_t k = 0; k < n; k++) {
            const double newest = residual(m, rest, k), d = newest - residual(m, i, k);
            share[i] += d * newest;
            for (size_t j = 0; j < rest; j++) a[i * rest + j] += d * (newest - residual(m, j, k));
        }
    }
    if (!sdm_fit_factorise(rest, a, factor, scale)) return false;
    sdm_fit_back(rest, factor, scale, share);
    return true;
}

void sdm_fit_mix(fit_mixing *m, size_t depth, size_t n, const double *x, double *y, double most)
{
    if (m->count > depth) drop_oldest(m, m->count - depth);
    memcpy(m->point[m->count], x, n * sizeof *x);
    memcpy(m->image[m->count++], y, n * sizeof *y);
    if (m->count > 1 && !(norm(m, m->count - 1, n) <= GROWTH_MOST * norm(m, m->count - 2, n)))
        drop_oldest(m, m->count - 1);
    double share[FIT_MIXING_DEPTH];
    while (m->count > 1 && !find_shares(m, n, share)) drop_oldest(m, 1);
    const size_t newest = m->count - 1;
    double change[FIT_MIXING_MAX], largest = 0;
    for (size_t k = 0; k < n; k++) {
        change[k] = 0;
        for (size_t i = 0; i < newest; i++)
            change[k] -= share[i] * (m->image[newest][k] - m->image[i][k]);
        largest = fmax(largest, fabs(change[k]));
    }
    for (size_t k = 0; k < n; k++)
        y[k] += largest > most ? change[k] * (most / largest) : change[k];
}
