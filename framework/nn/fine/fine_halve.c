/* Maps between their voxels by polynomials (Deslauriers and Dubuc 1989). Compiled without fused
   multiply-adds. */
#include "fine_halve.h"

#include <string.h>

#include "sdm/internal/heap.h"

/* Voxels that a polynomial goes through, at most. */
enum { TAPS = 6 };

/* The value halfway between voxels i and i + 1: the sum of weight[k] times voxel first + k. */
typedef struct midpoint {
    size_t first;
    float weight[TAPS];
} midpoint;

/* The midpoint behind voxel i of n > 1; weights beyond the number of voxels are 0. */
static midpoint find_midpoint(size_t i, size_t n)
{
    const size_t taps = n < TAPS ? n : TAPS;
    const size_t before = i < taps / 2 - 1 ? i : taps / 2 - 1, last = n - taps;
    midpoint m = {.first = i - before < last ? i - before : last};
    const double at = (double)(i - m.first) + 0.5;
    for (size_t k = 0; k < taps; k++) {
        double w = 1;
        for (size_t j = 0; j < taps; j++)
            if (j != k) w *= (at - (double)j) / ((double)k - (double)j);
        m.weight[k] = (float)w;
    }
    return m;
}

/* out[n] = the midpoint of rows[0 .. taps - 1], which are `step` floats apart. */
static void mix_rows(size_t n, size_t taps, const midpoint *m, const float *restrict rows,
                     size_t step, float *restrict out)
{
    const float *first = rows + m->first * step, *w = m->weight;
    if (taps == TAPS) {
        const float *restrict a = first, *restrict b = a + step, *restrict c = b + step,
                              *restrict d = c + step, *restrict e = d + step,
                              *restrict f = e + step;
        for (size_t i = 0; i < n; i++)
            out[i] = ((w[0] * a[i] + w[5] * f[i]) + (w[1] * b[i] + w[4] * e[i])) +
                     (w[2] * c[i] + w[3] * d[i]);
        return;
    }
    for (size_t i = 0; i < n; i++) {
        float sum = w[0] * first[i];
        for (size_t k = 1; k < taps; k++) sum += w[k] * first[k * step + i];
        out[i] = sum;
    }
}

/* One axis: from[outer][n][inner] becomes to[outer][2 n - 1][inner]. */
static void halve_axis(size_t outer, size_t n, size_t inner, const float *from, int n_threads,
                       float *to)
{
    const size_t taps = n < TAPS ? n : TAPS, rows = outer * n;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t r = 0; r < rows; r++) {
        const size_t i = r % n, o = r / n;
        float *row = to + (o * (2 * n - 1) + 2 * i) * inner;
        memcpy(row, from + r * inner, inner * sizeof *row);
        if (i + 1 == n) continue;
        const midpoint m = find_midpoint(i, n);
        mix_rows(inner, taps, &m, from + o * n * inner, inner, row + inner);
    }
}

/* middle[n - 1] of a row: those with three voxels on either side have the same weights. */
static void halve_row(size_t n, const midpoint *m, const float *from, float *middle)
{
    const size_t taps = n < TAPS ? n : TAPS, first = n < TAPS ? n : TAPS / 2 - 1,
                 last = n < TAPS ? n : n - TAPS / 2;
    for (size_t i = 0; i < first && i + 1 < n; i++) mix_rows(1, taps, &m[i], from, 1, middle + i);
    if (first >= n) return;
    const midpoint inner = {.weight = {m[first].weight[0], m[first].weight[1], m[first].weight[2],
                                       m[first].weight[3], m[first].weight[4], m[first].weight[5]}};
    mix_rows(last - first, taps, &inner, from, 1, middle + first);
    for (size_t i = last; i + 1 < n; i++) mix_rows(1, taps, &m[i], from, 1, middle + i);
}

/* The x axis: from[rows][n] becomes to[rows][2 n - 1]. */
static void halve_rows(size_t rows, size_t n, const midpoint *middle, const float *from,
                       int n_threads, float *to)
{
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t r = 0; r < rows; r++) {
        const float *own = from + r * n;
        float *row = to + r * (2 * n - 1);
        // the midpoints lie at the end of the row until they come into their places
        halve_row(n, middle, own, row + n);
        for (size_t i = 0; i + 1 < n; i++) {
            row[2 * i] = own[i];
            row[2 * i + 1] = row[n + i];
        }
        row[2 * n - 2] = own[n - 1];
    }
}

sdm_status sdm_fine_halve(const int64_t n[3], const float *map, int n_threads, float *fine,
                          sdm_error *err)
{
    const size_t nx = (size_t)n[0], ny = (size_t)n[1], nz = (size_t)n[2];
    const size_t fx = 2 * nx - 1, fy = 2 * ny - 1;
    float *along_x = NULL, *along_y = NULL;
    midpoint *middle = NULL;
    sdm_status s =
        sdm_alloc_unset((void **)&along_x, fx * ny * nz, sizeof *along_x, "fine map", err);
    if (!s) s = sdm_alloc_unset((void **)&along_y, fx * fy * nz, sizeof *along_y, "fine map", err);
    if (!s) s = SDM_ALLOC(&middle, nx, "fine map", err);
    if (!s) {
        for (size_t i = 0; i + 1 < nx; i++) middle[i] = find_midpoint(i, nx);
        halve_rows(ny * nz, nx, middle, map, n_threads, along_x);
        halve_axis(nz, ny, fx, along_x, n_threads, along_y);
        halve_axis(1, nz, fx * fy, along_y, n_threads, fine);
    }
    sdm_free(middle);
    sdm_free(along_y);
    sdm_free(along_x);
    return s;
}
