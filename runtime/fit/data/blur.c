/* Convolution with the discrete Gaussian T(k, t) = exp(-t) I_k(t), where k is the offset in voxels
 * and t the variance in voxels^2 (Lindeberg 1990). Its variance is exactly t, even where it is
 * narrower than a voxel, and dT/dt is half the second difference of T. T(-t), which sharpens, is
 * the inverse of T(t). */
#include "blur.h"

#include <math.h>

// largest number of taps on one side of the centre: 4 sd of the widest Gaussian
#define RADIUS_MAX 128

/* tap[0 .. r] = T(k, variance), normalised to sum 1 over both sides; returns r, the number of taps
 * on one side. The Bessel functions come from the downward recurrence I_{k-1} = I_{k+1} + 2k/t I_k
 * (Miller 1952). A negative variance uses I_k(-t) = (-1)^k I_k(t). */
static int gaussian_taps(double variance, double tap[RADIUS_MAX + 1])
{
    const double t = fabs(variance);
    if (!(t > 1e-12)) {
        tap[0] = 1;
        return 0;
    }
    int r = (int)fmin(ceil(6 * sqrt(t)) + 4, RADIUS_MAX);
    double above = 0, here = 1e-290, sum = 0;
    for (int k = r + 12; k >= 0; k--) { // here = I_k times an unknown factor
        if (k <= r) tap[k] = here;
        sum += k ? 2 * here : here;
        const double below = above + 2 * k / t * here;
        above = here;
        here = below;
        if (here > 1e200) { // against overflow: scale all numbers down together
            for (int i = k; i <= r; i++) tap[i] *= 1e-200;
            above *= 1e-200, here *= 1e-200, sum *= 1e-200;
        }
    }
    while (r > 0 && tap[r] < 1e-8 * sum) r--;
    // a negative variance alternates the signs; the taps that are kept are then normalised
    for (int k = 1; k <= r && variance < 0; k += 2) tap[k] = -tap[k];
    double kept = tap[0];
    for (int k = 1; k <= r; k++) kept += 2 * tap[k];
    for (int k = 0; k <= r; k++) tap[k] /= kept;
    return r;
}

sdm_status sdm_fit_blur_check(const sdm_grid *g, const char *name, double value, double sd,
                              sdm_error *err)
{
    const double voxel = fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2]));
    if (sd <= FIT_BLUR_MAX * voxel) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG,
                    "%s of %g mm spreads over %.3g voxels of %g mm, at most %g: make it smaller",
                    name, value, sd / voxel, voxel, FIT_BLUR_MAX);
}

static int64_t index_clamp(int64_t i, int64_t n) { return i < 0 ? 0 : i < n ? i : n - 1; }

// interior of a line: out[i] = tap[0] * in[i] + sum over k = 1 .. r of tap[k] * (in[i - k * step] +
// in[i + k * step])
static void blur_interior(const double *in, double *out, size_t n, size_t step, int r,
                          const double *tap)
{
    for (size_t i = 0; i < n; i++) out[i] = tap[0] * in[i];
    for (int k = 1; k <= r; k++) {
        const double *a = in - (size_t)k * step, *b = in + (size_t)k * step, w = tap[k];
        for (size_t i = 0; i < n; i++) out[i] += w * (a[i] + b[i]);
    }
}

// border of a line: computes its voxel i; the line has n voxels, `step` numbers apart, with `width`
// numbers each; beyond the line the values of its end voxels continue
static void blur_at_border(const double *in, double *out, int64_t i, int64_t n, size_t step,
                           size_t width, int r, const double *tap)
{
    double *to = out + (size_t)i * step;
    const double *centre = in + (size_t)i * step;
    for (size_t e = 0; e < width; e++) to[e] = tap[0] * centre[e];
    for (int k = 1; k <= r; k++) {
        const double *a = in + (size_t)index_clamp(i - k, n) * step,
                     *b = in + (size_t)index_clamp(i + k, n) * step;
        for (size_t e = 0; e < width; e++) to[e] += tap[k] * (a[e] + b[e]);
    }
}

// blurs a row along the first axis: both borders, and the interior between them
static void blur_row(const double *in, double *out, int64_t n, size_t n_fields, int r,
                     const double *tap)
{
    const int64_t from = r < n ? r : n, to = n - r > from ? n - r : from;
    for (int64_t i = 0; i < from; i++) blur_at_border(in, out, i, n, n_fields, n_fields, r, tap);
    const size_t first = (size_t)from * n_fields;
    if (to > from)
        blur_interior(in + first, out + first, (size_t)(to - from) * n_fields, n_fields, r, tap);
    for (int64_t i = to; i < n; i++) blur_at_border(in, out, i, n, n_fields, n_fields, r, tap);
}

// variance that interpolation by cubic B-splines adds along an axis, voxels^2
#define SPLINE_VARIANCE (1.0 / 3)

void sdm_fit_blur(const sdm_grid *g, size_t n_fields, double variance, bool splines, int n_threads,
                  double **packed, double **spare)
{
    const double less = splines ? SPLINE_VARIANCE : 0;
    (void)n_threads; // unused without OpenMP
    const size_t row = n_fields * (size_t)g->n[0], step[3] = {n_fields, row, row * (size_t)g->n[1]};
    for (int axis = 0; axis < 3; axis++) {
        double tap[RADIUS_MAX + 1];
        const int r = gaussian_taps(variance / (g->spacing[axis] * g->spacing[axis]) - less, tap);
        if (r == 0) continue;
        // each `line` is a row of voxels along the first axis; along the other axes whole rows are
        // added
        const double *in = *packed;
        double *out = *spare;
#pragma omp parallel for schedule(static) num_threads(n_threads)
        for (int64_t line = 0; line < g->n[1] * g->n[2]; line++) {
            const int64_t j = line % g->n[1], k = line / g->n[1], at = axis == 1 ? j : k,
                          n = g->n[axis];
            const size_t start = (size_t)line * row, origin = start - (size_t)at * step[axis];
            if (axis == 0)
                blur_row(in + start, out + start, n, n_fields, r, tap);
            else if (at >= r && at + r < n)
                blur_interior(in + start, out + start, row, step[axis], r, tap);
            else
                blur_at_border(in + origin, out + origin, at, n, step[axis], row, r, tap);
        }
        *spare = *packed;
        *packed = out;
    }
}

void sdm_fit_laplacian(const sdm_grid *g, size_t n_fields, double scale, int n_threads,
                       double *packed)
{
    (void)n_threads; // unused without OpenMP
    const size_t step[3] = {n_fields, n_fields * (size_t)g->n[0],
                            n_fields * (size_t)(g->n[0] * g->n[1])};
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (int64_t row = 0; row < g->n[1] * g->n[2]; row++) {
        int64_t index[3] = {0, row % g->n[1], row / g->n[1]};
        for (index[0] = 0; index[0] < g->n[0]; index[0]++) {
            double *f = packed + (size_t)(row * g->n[0] + index[0]) * n_fields;
            double sum = 0;
            for (int a = 0; a < 3; a++) {
                const double before = index[a] > 0 ? f[-(ptrdiff_t)step[a]] : f[0];
                const double after = index[a] + 1 < g->n[a] ? f[step[a]] : f[0];
                sum += (before + after - 2 * f[0]) / (g->spacing[a] * g->spacing[a]);
            }
            f[n_fields - 1] = scale * sum;
        }
    }
}
