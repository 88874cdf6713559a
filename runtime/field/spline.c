/* Coefficients of interpolating cubic B-splines: a tridiagonal system along each axis (Unser,
   Aldroubi and Eden 1991), solved for many lines at once. */
#include "spline.h"

#include <string.h>

#include "sdm/internal/threads.h"
#include "spline_kernels.h"

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

/* Floats for the factors of all axes, and for spline_table.fit_rows. */
static size_t factor_floats(const spline_shape *s)
{
    const size_t n = (size_t)(s->n[0] + s->n[1] + s->n[2]);
    return (n + SPLINE_LINES - 1) / SPLINE_LINES * SPLINE_LINES; // what follows is aligned
}
static size_t rows_floats(const spline_shape *s) { return SPLINE_LINES * (size_t)s->n[0]; }

size_t sdm_spline_scratch(const spline_shape *s, int n_threads)
{
    return factor_floats(s) + (size_t)n_threads * rows_floats(s);
}

/* Along x: rows values[rows][n[0]] of a plane, to c. memory[rows_floats()], 64-byte aligned. */
static void fit_plane(const spline_shape *s, const float *values, const float *factor,
                      const spline_table *kernels, float *memory, float *c)
{
    const size_t n = (size_t)s->n[0], rows = (size_t)s->n[1], to = s->step[1];
    if (n > 2 && rows >= SPLINE_LINES) {
        // the last rows overlap those before
        for (size_t j = 0; j < rows; j += SPLINE_LINES) {
            const size_t first = rows - j < SPLINE_LINES ? rows - SPLINE_LINES : j;
            kernels->fit_rows(values + first * n, n, n, factor, c + first * to, to, memory);
        }
    } else {
        for (size_t j = 0; j < rows; j++) {
            memcpy(c + j * to, values + j * n, n * sizeof *c);
            if (n > 2) kernels->solve(c + j * to, n, 1, 1, factor);
        }
    }
    for (size_t j = 0; j < rows; j++) extend(c + j * to - 1, s->n[0], s->padded[0], 1, 1);
}

void sdm_spline_fit(const spline_shape *s, const float *values, int n_threads, float *scratch,
                    float *c)
{
    const size_t *n = s->padded, *step = s->step, plane = (size_t)(s->n[0] * s->n[1]);
    const spline_table *kernels = sdm_spline_kernels();
    float *factor = scratch, *factor_y = factor + s->n[0], *memory = scratch + factor_floats(s);
    if (s->n[0] > 2) eliminate(s->n[0], factor);
    if (s->n[1] > 2) eliminate(s->n[1], factor_y);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t k = 0; k < s->n[2]; k++) {
        float *rows = c + (size_t)(k + 1) * step[2];
        fit_plane(s, values + (size_t)k * plane, factor, kernels,
                  memory + (size_t)sdm_thread() * rows_floats(s), rows + step[1] + step[0]);
        // along y: whole padded rows
        if (s->n[1] > 2) kernels->solve(rows + step[1], (size_t)s->n[1], step[1], n[0], factor_y);
        extend(rows, s->n[1], n[1], step[1], n[0]);
    }
    // along z
    if (s->n[2] > 2) eliminate(s->n[2], factor);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t j = 0; j < n[1]; j++) {
        float *column = c + j * step[1];
        if (s->n[2] > 2) kernels->solve(column + step[2], (size_t)s->n[2], step[2], n[0], factor);
        extend(column, s->n[2], n[2], step[2], n[0]);
    }
}
