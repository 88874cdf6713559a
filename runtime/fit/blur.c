/* The discrete Gaussian T(k, t) = exp(-t) I_k(t) (Lindeberg 1990): its variance is t exactly, however narrow, and dT/dt is half the second
   difference of T. */
#include "blur.h"

#include <math.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

// taps on one side at most: a blur of 16 voxels and its tail
#define RADIUS_MAX 128
// a field at most, see FIT_FIELDS_MAX
#define LINE_FIELDS 80

int sdm_fit_threads(int wanted)
{
#ifdef _OPENMP
    return wanted > 0 ? wanted : omp_get_max_threads();
#else
    (void)wanted;
    return 1;
#endif
}

/* T(0..r, t), normalised; returns r. Downward recurrence I_{k-1} = I_{k+1} + 2k/t I_k (Miller 1952). */
static int gaussian(double t, double tap[RADIUS_MAX + 1])
{
    if (!(t > 1e-12)) {
        tap[0] = 1;
        return 0;
    }
    int r = (int)ceil(6 * sqrt(t)) + 4;
    if (r > RADIUS_MAX) r = RADIUS_MAX;
    double above = 0, here = 1e-290, sum = 0;
    for (int k = r + 12; k >= 0; k--) { // here = I_k up to a factor
        if (k <= r) tap[k] = here;
        sum += k ? 2 * here : here;
        const double below = above + 2 * k / t * here;
        above = here;
        here = below;
        if (here > 1e200) { // scaled down together
            for (int i = k; i <= r; i++) tap[i] *= 1e-200;
            above *= 1e-200, here *= 1e-200, sum *= 1e-200;
        }
    }
    while (r > 0 && tap[r] < 1e-8 * sum) r--; // below float rounding
    double kept = tap[0];
    for (int k = 1; k <= r; k++) kept += 2 * tap[k];
    for (int k = 0; k <= r; k++) tap[k] /= kept;
    return r;
}

static int64_t clamp(int64_t i, int64_t n) { return i < 0 ? 0 : i < n ? i : n - 1; }

// the first fields of one line of n voxels that are `step` apart
static void blur_line(const float *in, float *out, int64_t n, size_t step, size_t n_blurred, int r, const double *tap)
{
    for (int64_t i = 0; i < n; i++) {
        float sum[LINE_FIELDS];
        const float *centre = in + (size_t)i * step, w0 = (float)tap[0];
        for (size_t f = 0; f < n_blurred; f++) sum[f] = w0 * centre[f];
        for (int k = 1; k <= r; k++) {
            const float *a = in + (size_t)clamp(i - k, n) * step, *b = in + (size_t)clamp(i + k, n) * step;
            const float w = (float)tap[k];
            for (size_t f = 0; f < n_blurred; f++) sum[f] += w * (a[f] + b[f]);
        }
        memcpy(out + (size_t)i * step, sum, n_blurred * sizeof *sum);
    }
}

void sdm_fit_blur(const sdm_grid *g, size_t n_fields, size_t n_blurred, double variance, int n_threads, float **packed,
                  float **spare)
{
    (void)n_threads; // without OpenMP
    const size_t step[3] = {n_fields, n_fields * (size_t)g->n[0], n_fields * (size_t)(g->n[0] * g->n[1])};
    for (int axis = 0; axis < 3; axis++) {
        double tap[RADIUS_MAX + 1];
        const int r = gaussian(variance / (g->spacing[axis] * g->spacing[axis]), tap);
        if (r == 0) continue;
        const int b = (axis + 1) % 3, c = (axis + 2) % 3;
        const float *in = *packed;
        float *out = *spare;
#pragma omp parallel for schedule(static) num_threads(n_threads)
        for (int64_t line = 0; line < g->n[b] * g->n[c]; line++) {
            const size_t from = (size_t)(line % g->n[b]) * step[b] + (size_t)(line / g->n[b]) * step[c];
            blur_line(in + from, out + from, g->n[axis], step[axis], n_blurred, r, tap);
        }
        *spare = *packed;
        *packed = out;
    }
}

void sdm_fit_laplacian(const sdm_grid *g, size_t n_fields, double scale, int n_threads, float *packed)
{
    (void)n_threads; // without OpenMP
    const size_t step[3] = {n_fields, n_fields * (size_t)g->n[0], n_fields * (size_t)(g->n[0] * g->n[1])};
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int64_t row = 0; row < g->n[1] * g->n[2]; row++) {
        int64_t index[3] = {0, row % g->n[1], row / g->n[1]};
        for (index[0] = 0; index[0] < g->n[0]; index[0]++) {
            float *f = packed + (size_t)(row * g->n[0] + index[0]) * n_fields;
            double sum = 0;
            for (int a = 0; a < 3; a++) {
                const double before = (double)(index[a] > 0 ? f[-(ptrdiff_t)step[a]] : f[0]);
                const double after = (double)(index[a] + 1 < g->n[a] ? f[step[a]] : f[0]);
                sum += (before + after - 2 * (double)f[0]) / (g->spacing[a] * g->spacing[a]);
            }
            f[n_fields - 1] = (float)(scale * sum);
        }
    }
}
