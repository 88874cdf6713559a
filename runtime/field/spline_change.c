/* Bounds on the change of a spline from the differences of its coefficients. */
#include "spline_change.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "spline_kernels.h"

/* Coefficients with an influence in a brick, along an axis. */
enum { WINDOW = SPLINE_WINDOW };
_Static_assert(SPLINE_BRICK + 3 == SPLINE_WINDOW, "the kernels take windows of this size");

static inline float larger(float a, float b) { return a > b ? a : b; }

/* The end of these coefficients of brick b along axis a. */
static size_t window_end(const spline_shape *s, int a, size_t b)
{
    const size_t end = b * SPLINE_BRICK + WINDOW;
    return end < s->padded[a] ? end : s->padded[a];
}

/* from[WINDOW] = the planes or rows first .. end - 1 of `size` floats, the last one repeated: that
   changes no maximum. */
static void list_window(const float *c, size_t size, size_t first, size_t end,
                        const float *from[WINDOW])
{
    for (size_t k = 0; k < WINDOW; k++)
        from[k] = c + (first + k < end ? first + k : end - 1) * size;
}

/* four[n] = the largest of row[i] .. row[i + 3]. */
static void take_fours(const float *restrict row, size_t n, float *restrict four)
{
    for (size_t i = 0; i < n; i++)
        four[i] = larger(larger(row[i], row[i + 1]), larger(row[i + 2], row[i + 3]));
}

/* plane[3][size of a plane] = the largest differences along x, y and z over the planes of layer b
   of bricks, for rows of bricks. Differences along x from the last coefficient of a row, and along
   y from the last row, are not used. */
static void layer_differences(const spline_shape *s, const float *c, size_t b, brick_rows rows,
                              float *plane)
{
    const size_t size = s->step[2], line = s->step[1], first = rows.first * SPLINE_BRICK * line,
                 n = window_end(s, 1, rows.last - 1) * line - first;
    const spline_table *kernels = sdm_spline_kernels();
    const float *window[WINDOW];
    list_window(c, size, b * SPLINE_BRICK, window_end(s, 2, b), window);
    for (size_t k = 0; k < WINDOW; k++) window[k] += first;
    kernels->differences(window, n - 1, 1, plane + first);
    kernels->differences(window, n - line, line, plane + size + first);
    kernels->steps(window, n, plane + 2 * size + first);
}

/* Floats of a row, with zeros after its end for the windows of the last bricks. */
static size_t row_size(const spline_shape *s) { return s->padded[0] + WINDOW; }

/* The bounds of the bricks in rows of layer b; row[6][row_size()]: memory, zeros at the ends of the
   rows. */
static void layer_bounds(const spline_shape *s, const double reach[3], const float *plane, size_t b,
                         brick_rows rows, float *row, spline_change *out)
{
    const size_t nx = s->padded[0], size = s->step[2], next = row_size(s);
    const spline_table *kernels = sdm_spline_kernels();
    float *to = out->max + (b * out->n[1] + rows.first) * out->n[0], *four = row + 3 * next;
    for (size_t j = rows.first; j < rows.last; j++) {
        for (size_t a = 0; a < 3; a++) {
            const float *window[WINDOW];
            list_window(plane + a * size, nx, j * SPLINE_BRICK, window_end(s, 1, j) - (a == 1),
                        window);
            kernels->largest(window, nx, row + a * next);
            if (a == 0) row[nx - 1] = 0; // the last coefficient has no next one
            take_fours(row + a * next, nx, four + a * next);
        }
        for (size_t x = 0; x < out->n[0] * SPLINE_BRICK; x += SPLINE_BRICK) {
            double sum = (double)four[x] * reach[0];
            for (size_t a = 1; a < 3; a++)
                sum += (double)larger(four[a * next + x], row[a * next + x + 4]) * reach[a];
            *to++ = (float)sum * (1 + 1e-5f); // covers roundings
        }
    }
}

void sdm_spline_bricks(const spline_shape *s, size_t n[3])
{
    for (int a = 0; a < 3; a++) n[a] = (s->padded[a] - 3 + SPLINE_BRICK - 1) / SPLINE_BRICK;
}

sdm_status sdm_spline_change_create(const spline_shape *s, const double reach[3], const float *c,
                                    const brick_rows *asked, int n_threads, spline_change *out,
                                    sdm_error *err)
{
    memset(out, 0, sizeof *out);
    sdm_spline_bricks(s, out->n);
    const size_t own = 3 * s->step[2] + 6 * row_size(s), bricks = out->n[0] * out->n[1] * out->n[2];
    float *memory = NULL;
    sdm_status status = SDM_ALLOC(&out->max, bricks, "bounds on changes", err);
    if (!status)
        status = SDM_ALLOC(&memory, own * (size_t)n_threads, "differences of coefficients", err);
    if (status) return status;
#pragma omp parallel for schedule(dynamic) num_threads(n_threads) if (n_threads > 1)
    for (size_t b = 0; b < out->n[2]; b++) {
        const brick_rows rows = asked ? asked[b] : (brick_rows){0, out->n[1]};
        float *plane = memory + own * (size_t)sdm_thread();
        if (rows.first >= rows.last) continue;
        layer_differences(s, c, b, rows, plane);
        layer_bounds(s, reach, plane, b, rows, plane + 3 * s->step[2], out);
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
