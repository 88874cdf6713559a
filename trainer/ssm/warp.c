/* Warps of a surface that move some points onto others. The kernel is |x - y|, whose negative is
 * positive definite for weights that annihilate linear functions. |x| + |y| - |x - y| gives such
 * weights the same sums, up to constants, and is positive definite everywhere but at its origin, so
 * that Cholesky factors do. */
#include <math.h>
#include <string.h>

#include "numerics/linalg.h"
#include "sdm/internal/ssm_build.h"
#include "sdm/memory.h"

/* The linear functions: 1, x, y and z. */
enum { N_LINEAR = 4 };

/* Coordinates relative to `origin`, a point outside the box of the points, in units of its size. */
typedef struct warp {
    size_t n; /* points */
    double origin[3], unit;
    double *point, *norm; /* [n][3], [n]: the points in these coordinates, and their norms */
    double *matrix;       /* [n][n]: Cholesky factor of the kernel */
    double *linear;       /* [n][4]: the linear functions at the points */
    double *solved;       /* [n][4]: kernel^-1 linear */
    double schur[N_LINEAR * N_LINEAR]; /* Cholesky factor of linear^T kernel^-1 linear */
} warp;

static double norm(const double x[3]) { return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]); }

static void into_frame(const warp *w, const double x[3], double out[3])
{
    for (size_t d = 0; d < 3; d++) out[d] = (x[d] - w->origin[d]) / w->unit;
}

static double kernel(const double x[3], double norm_x, const double y[3], double norm_y)
{
    const double between[3] = {x[0] - y[0], x[1] - y[1], x[2] - y[2]};
    return norm_x + norm_y - norm(between);
}

static sdm_status choose_frame(warp *w, const double *from, sdm_error *err)
{
    w->unit = 0;
    for (size_t d = 0; d < 3; d++) {
        double low = from[d], high = from[d];
        for (size_t i = 1; i < w->n; i++) {
            low = fmin(low, from[3 * i + d]);
            high = fmax(high, from[3 * i + d]);
        }
        w->unit = fmax(w->unit, high - low);
        w->origin[d] = low;
    }
    if (!(w->unit > 0 && isfinite(w->unit)))
        return sdm_fail(err, SDM_E_ARG, "all %zu points are at the same place", w->n);
    for (size_t d = 0; d < 3; d++) w->origin[d] -= w->unit;
    return SDM_OK;
}

/* Fills the lower triangle of the kernel; points at the same place are refused. */
static sdm_status fill_matrix(warp *w, sdm_error *err)
{
    for (size_t i = 0; i < w->n; i++)
        for (size_t j = 0; j <= i; j++) {
            const double k = kernel(w->point + 3 * i, w->norm[i], w->point + 3 * j, w->norm[j]);
            if (j < i && w->norm[i] + w->norm[j] - k < 1e-9)
                return sdm_fail(err, SDM_E_ARG, "points %zu and %zu are at the same place", j + 1,
                                i + 1);
            w->matrix[w->n * i + j] = k;
        }
    return SDM_OK;
}

static sdm_status factorise(warp *w, sdm_error *err)
{
    const sdm_status s = fill_matrix(w, err);
    if (s) return s;
    if (trainer_cholesky(w->n, w->matrix))
        return sdm_fail(err, SDM_E_ARG, "the %zu points are too close to each other", w->n);
    memcpy(w->solved, w->linear, N_LINEAR * w->n * sizeof *w->solved);
    trainer_cholesky_solve(w->n, w->matrix, N_LINEAR, w->solved);
    for (size_t a = 0; a < N_LINEAR; a++)
        for (size_t b = 0; b < N_LINEAR; b++) {
            double sum = 0;
            for (size_t i = 0; i < w->n; i++)
                sum += w->linear[N_LINEAR * i + a] * w->solved[N_LINEAR * i + b];
            w->schur[N_LINEAR * a + b] = sum;
        }
    if (trainer_cholesky(N_LINEAR, w->schur) || !(w->schur[N_LINEAR * N_LINEAR - 1] > 1e-6))
        return sdm_fail(err, SDM_E_ARG, "the %zu points are in one plane", w->n);
    return SDM_OK;
}

static sdm_status prepare(warp *w, const double *from, sdm_error *err)
{
    sdm_status s = choose_frame(w, from, err);
    if (!s) s = SDM_ALLOC(&w->point, 3 * w->n, "points of a warp", err);
    if (!s) s = SDM_ALLOC(&w->norm, w->n, "points of a warp", err);
    if (!s) s = SDM_ALLOC(&w->linear, N_LINEAR * w->n, "points of a warp", err);
    if (!s) s = SDM_ALLOC(&w->solved, N_LINEAR * w->n, "points of a warp", err);
    if (!s) s = SDM_ALLOC(&w->matrix, w->n * w->n, "matrix of a warp", err);
    for (size_t i = 0; i < w->n && !s; i++) {
        double *x = w->point + 3 * i;
        into_frame(w, from + 3 * i, x);
        w->norm[i] = norm(x);
        w->linear[N_LINEAR * i] = 1;
        memcpy(w->linear + N_LINEAR * i + 1, x, 3 * sizeof *x);
    }
    return s ? s : factorise(w, err);
}

static void dispose(warp *w)
{
    sdm_free(w->point);
    sdm_free(w->norm);
    sdm_free(w->linear);
    sdm_free(w->solved);
    sdm_free(w->matrix);
}

/* linear[4][columns] and, in place of the values[n][columns], the weights of the kernel. */
static void solve(const warp *w, size_t columns, double *values, double *linear)
{
    for (size_t a = 0; a < N_LINEAR; a++)
        for (size_t c = 0; c < columns; c++) {
            double sum = 0;
            for (size_t i = 0; i < w->n; i++)
                sum += w->solved[N_LINEAR * i + a] * values[columns * i + c];
            linear[columns * a + c] = sum;
        }
    trainer_cholesky_solve(N_LINEAR, w->schur, columns, linear);
    for (size_t i = 0; i < w->n; i++)
        for (size_t a = 0; a < N_LINEAR; a++)
            for (size_t c = 0; c < columns; c++)
                values[columns * i + c] -= w->linear[N_LINEAR * i + a] * linear[columns * a + c];
    trainer_cholesky_solve(w->n, w->matrix, columns, values);
}

/* row[columns] = the warped vertex x in all shapes. */
static void evaluate(const warp *w, const double x[3], size_t columns, const double *weights,
                     const double *linear, double *row)
{
    double at[3];
    into_frame(w, x, at);
    const double norm_at = norm(at);
    for (size_t c = 0; c < columns; c++)
        row[c] = linear[c] + at[0] * linear[columns + c] + at[1] * linear[2 * columns + c] +
                 at[2] * linear[3 * columns + c];
    for (size_t i = 0; i < w->n; i++) {
        const double k = kernel(at, norm_at, w->point + 3 * i, w->norm[i]);
        for (size_t c = 0; c < columns; c++) row[c] += k * weights[columns * i + c];
    }
}

sdm_status sdm_ssm_warp(size_t n_point, const double *from, size_t n, const double *to,
                        size_t n_vert, const double *vert, double *out, sdm_error *err)
{
    const size_t columns = 3 * n;
    double *weights = NULL, *linear = NULL, *row = NULL;
    warp w = {.n = n_point};
    if (n_point < N_LINEAR || n_point > SDM_SSM_WARP_MAX)
        return sdm_fail(err, SDM_E_ARG, "%zu points, a warp needs %d to %d", n_point, N_LINEAR,
                        SDM_SSM_WARP_MAX);
    sdm_status s = prepare(&w, from, err);
    if (!s) s = SDM_ALLOC(&weights, n_point * columns, "weights of a warp", err);
    if (!s) s = SDM_ALLOC(&linear, N_LINEAR * columns, "weights of a warp", err);
    if (!s) s = SDM_ALLOC(&row, columns, "weights of a warp", err);
    if (!s) {
        for (size_t k = 0; k < n; k++)
            for (size_t i = 0; i < n_point; i++)
                memcpy(weights + columns * i + 3 * k, to + 3 * (n_point * k + i), 3 * sizeof *to);
        solve(&w, columns, weights, linear);
    }
    for (size_t v = 0; v < n_vert && !s; v++) {
        evaluate(&w, vert + 3 * v, columns, weights, linear, row);
        for (size_t k = 0; k < n; k++)
            memcpy(out + 3 * (n_vert * k + v), row + 3 * k, 3 * sizeof *out);
    }
    sdm_free(row);
    sdm_free(linear);
    sdm_free(weights);
    dispose(&w);
    return s;
}
