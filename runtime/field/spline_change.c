/* Bounds on the change of a spline from the differences of its coefficients. */
#include "spline_change.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"

/* Coefficients with an influence in a brick, along an axis. */
enum { WINDOW = SPLINE_BRICK + 3 };

static inline float larger(float a, float b) { return a > b ? a : b; }

/* The end of these coefficients of brick b along axis a. */
static size_t window_end(const spline_shape *s, int a, size_t b)
{
    const size_t end = b * SPLINE_BRICK + WINDOW;
    return end < s->padded[a] ? end : s->padded[a];
}

/* most[i] = max(most[i], abs(c[i + step] - c[i])). */
static void take_differences(const float *restrict c, const float *restrict next, size_t n,
                             float *restrict most)
{
    for (size_t i = 0; i < n; i++) most[i] = larger(most[i], fabsf(next[i] - c[i]));
}

static void take_largest(const float *restrict from, size_t n, float *restrict most)
{
    for (size_t i = 0; i < n; i++) most[i] = larger(most[i], from[i]);
}

/* plane[3][size of a plane] = the largest differences along x, y and z over the planes of layer b
   of bricks. Differences along x from the last coefficient of a row, and along y from the last row,
   are not used. */
static void layer_differences(const spline_shape *s, const float *c, size_t b, float *plane)
{
    const size_t size = s->step[2], first = b * SPLINE_BRICK, end = window_end(s, 2, b);
    memset(plane, 0, 3 * size * sizeof *plane);
    for (size_t k = first; k < end; k++) {
        const float *at = c + k * size;
        take_differences(at, at + 1, size - 1, plane);
        take_differences(at, at + s->step[1], size - s->step[1], plane + size);
        if (k + 1 < end) take_differences(at, at + size, size, plane + 2 * size);
    }
}

/* The bound of brick (i, j) of a layer; row[3][padded x]: the largest differences over its rows. */
static float brick_bound(const spline_shape *s, const double reach[3], const float *row, size_t i)
{
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        const size_t end = window_end(s, 0, i) - (a == 0);
        float most = 0;
        for (size_t x = i * SPLINE_BRICK; x < end; x++)
            most = larger(most, row[(size_t)a * s->padded[0] + x]);
        sum += (double)most * reach[a];
    }
    return (float)sum * (1 + 1e-5f); // covers roundings
}

static void layer_bounds(const spline_shape *s, const double reach[3], const float *plane, size_t b,
                         float *row, spline_change *out)
{
    const size_t nx = s->padded[0], size = s->step[2];
    float *to = out->max + b * out->n[0] * out->n[1];
    for (size_t j = 0; j < out->n[1]; j++) {
        const size_t end = window_end(s, 1, j);
        memset(row, 0, 3 * nx * sizeof *row);
        for (size_t y = j * SPLINE_BRICK; y < end; y++)
            for (size_t a = 0; a < 3; a++)
                if (a != 1 || y + 1 < end)
                    take_largest(plane + a * size + y * nx, nx, row + a * nx);
        for (size_t i = 0; i < out->n[0]; i++) *to++ = brick_bound(s, reach, row, i);
    }
}

sdm_status sdm_spline_change_create(const spline_shape *s, const double reach[3], const float *c,
                                    int n_threads, spline_change *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    for (int a = 0; a < 3; a++) out->n[a] = (s->padded[a] - 3 + SPLINE_BRICK - 1) / SPLINE_BRICK;
    const size_t own = 3 * s->step[2] + 3 * s->padded[0],
                 bricks = out->n[0] * out->n[1] * out->n[2];
    float *memory = NULL;
    sdm_status status = SDM_ALLOC(&out->max, bricks, "bounds on changes", err);
    if (!status)
        status = SDM_ALLOC(&memory, own * (size_t)n_threads, "differences of coefficients", err);
    if (status) return status;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t b = 0; b < out->n[2]; b++) {
        float *plane = memory + own * (size_t)sdm_thread();
        layer_differences(s, c, b, plane);
        layer_bounds(s, reach, plane, b, plane + 3 * s->step[2], out);
    }
    for (size_t i = 0; i < bricks; i++) out->all = larger(out->all, out->max[i]);
    sdm_free(memory);
    return SDM_OK;
}

void sdm_spline_change_dispose(spline_change *b)
{
    sdm_free(b->max);
    memset(b, 0, sizeof *b);
}
