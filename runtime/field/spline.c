/* Coefficients of interpolating cubic B-splines: a tridiagonal system along each axis (Unser,
   Aldroubi and Eden 1991), solved for many lines at once. */
#include "spline.h"

#include <string.h>

/* Lines that the solver along x takes at once: their recursions overlap. */
enum { LINES = 16 };

spline_shape sdm_spline_shape(const int64_t n[3])
{
    spline_shape s = {.step = {1}, .count = 1};
    for (int a = 0; a < 3; a++) {
        s.n[a] = n[a];
        s.padded[a] = (size_t)(n[a] > 2 ? n[a] : 2) + 2;
        s.step[a] = s.count;
        s.count *= s.padded[a];
    }
    return s;
}

/* The equations of an axis of n > 2 voxels: c[i - 1] + 4 c[i] + c[i + 1] = 6 f[i] inside, and
   c[0] - c[1] = f[0] - f[1] at the end, likewise at the other: together with a third difference of
   zero they interpolate the end too. Elimination leaves c[i] = d[i] - u[i] c[i + 1]; factor[n] =
   u. */
static void eliminate(int64_t n, float *factor)
{
    double u = -1;
    factor[0] = -1;
    for (int64_t i = 1; i < n; i++) factor[i] = (float)(u = 1 / (4 - u));
}

/* Solves the system for `width` lines whose first elements are `apart` floats apart; elements of a
   line are `step` apart. */
static void solve(float *c, int64_t n, size_t step, size_t width, size_t apart, const float *factor)
{
    const size_t last = (size_t)n - 1;
    for (size_t w = 0; w < width; w++) {
        float *line = c + w * apart;
        const float end = line[last * step] - line[(last - 1) * step];
        line[0] -= line[step];
        line[last * step] = end;
    }
    for (size_t i = 1; i < last; i++)
        for (size_t w = 0; w < width; w++) {
            float *at = c + w * apart + i * step;
            at[0] = (6 * at[0] - at[-(ptrdiff_t)step]) * factor[i];
        }
    const float closing = 1 / (1 + factor[last - 1]);
    for (size_t w = 0; w < width; w++) {
        float *at = c + w * apart + last * step;
        at[0] = (at[0] + at[-(ptrdiff_t)step]) * closing;
    }
    for (size_t i = last; i-- > 0;)
        for (size_t w = 0; w < width; w++) {
            float *at = c + w * apart + i * step;
            at[0] -= factor[i] * at[step];
        }
}

/* The coefficient beyond an end: the third difference is zero, or on a short axis the second or the
   first one. c: the coefficient at the end; inward: distance to the next one. */
static float beyond_end(const float *c, int64_t n, ptrdiff_t inward)
{
    if (n == 1) return c[0];
    return n == 2 ? 2 * c[0] - c[inward] : 3 * (c[0] - c[inward]) + c[2 * inward];
}

/* Fills the coefficients beyond the ends of `width` lines, neighbours in memory. */
static void extend(float *first, int64_t n, size_t padded, size_t step, size_t width)
{
    const ptrdiff_t in = (ptrdiff_t)step;
    for (size_t w = 0; w < width; w++) {
        float *c = first + w, *end = c + (size_t)n * step;
        *c = beyond_end(c + in, n, in);
        for (float *to = end + in; to <= c + (padded - 1) * step; to += in)
            *to = n == 1 ? end[0] : beyond_end(end, n, -in);
    }
}

static void fit_rows(const spline_shape *s, int n_threads, float *factor, float *c)
{
    const int64_t rows = s->n[1] * s->n[2];
    float *inner = c + s->step[0] + s->step[1] + s->step[2];
    if (s->n[0] > 2) eliminate(s->n[0], factor);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t k = 0; k < s->n[2]; k++) {
        float *plane = inner + (size_t)k * s->step[2];
        for (int64_t j = 0; s->n[0] > 2 && j < s->n[1]; j += LINES)
            solve(plane + (size_t)j * s->step[1], s->n[0], 1,
                  (size_t)(s->n[1] - j < LINES ? s->n[1] - j : LINES), s->step[1], factor);
    }
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t r = 0; r < rows; r++)
        extend(inner + (size_t)(r / s->n[1]) * s->step[2] + (size_t)(r % s->n[1]) * s->step[1] - 1,
               s->n[0], s->padded[0], 1, 1);
}

void sdm_spline_fit(const spline_shape *s, const float *values, int n_threads, float *factor,
                    float *c)
{
    const size_t *n = s->padded, *step = s->step;
    for (int64_t k = 0; k < s->n[2]; k++)
        for (int64_t j = 0; j < s->n[1]; j++)
            memcpy(c + step[0] + (size_t)(j + 1) * step[1] + (size_t)(k + 1) * step[2],
                   values + (k * s->n[1] + j) * s->n[0], (size_t)s->n[0] * sizeof *c);
    fit_rows(s, n_threads, factor, c);
    // along y: whole padded rows
    if (s->n[1] > 2) eliminate(s->n[1], factor);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t k = 0; k < s->n[2]; k++) {
        float *plane = c + (size_t)(k + 1) * step[2];
        if (s->n[1] > 2) solve(plane + step[1], s->n[1], step[1], n[0], 1, factor);
        extend(plane, s->n[1], n[1], step[1], n[0]);
    }
    // along z
    if (s->n[2] > 2) eliminate(s->n[2], factor);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t j = 0; j < n[1]; j++) {
        float *column = c + j * step[1];
        if (s->n[2] > 2) solve(column + step[2], s->n[2], step[2], n[0], 1, factor);
        extend(column, s->n[2], n[2], step[2], n[0]);
    }
}
