/* Eigenvalues, Cholesky factors and orthonormal bases of dense matrices. */
#include "linalg.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

/* Dot product in eight partial sums, so that the additions do not wait for each other. */
static double dot(size_t n, const double *a, const double *b)
{
    double sum[8] = {0}, rest = 0;
    size_t i = 0;
    for (; i + 8 <= n; i += 8)
        for (size_t j = 0; j < 8; j++) sum[j] += a[i + j] * b[i + j];
    for (; i < n; i++) rest += a[i] * b[i];
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7])) + rest;
}

static void add_scaled(size_t n, double f, const double *x, double *y)
{
    for (size_t i = 0; i < n; i++) y[i] += f * x[i];
}

/* Reduces the symmetric a to tridiagonal form with Householder reflections: d[n] diagonal, e[n]
   sub-diagonal (e[0] = 0). a becomes the orthogonal transformation, whose columns are the new
   basis. work[n] is scratch memory. */
static void tridiagonalise(size_t n, double *a, double *d, double *e, double *work)
{
#define A(i, j) a[(i)*n + (j)]
    for (size_t i = n - 1; i > 0; i--) {
        // scale row i; a zero row needs no reflection
        double h = 0, scale = 0;
        if (i > 1)
            for (size_t k = 0; k < i; k++) scale += fabs(A(i, k));
        if (!(scale > 0)) {
            e[i] = A(i, i - 1);
            d[i] = 0;
            continue;
        }
        for (size_t k = 0; k < i; k++) {
            A(i, k) /= scale;
            h += A(i, k) * A(i, k);
        }
        // store the Householder vector in row i
        const double f0 = A(i, i - 1), g0 = f0 >= 0 ? -sqrt(h) : sqrt(h);
        e[i] = scale * g0;
        h -= f0 * g0;
        A(i, i - 1) = f0 - g0;
        // e = A times row i, reading only the lower triangle, row by row
        double f = 0;
        memset(e, 0, i * sizeof *e);
        for (size_t j = 0; j < i; j++) {
            A(j, i) = A(i, j) / h;
            e[j] += dot(j + 1, &A(j, 0), &A(i, 0));
            add_scaled(j, A(i, j), &A(j, 0), e);
        }
        for (size_t j = 0; j < i; j++) {
            e[j] /= h;
            f += e[j] * A(i, j);
        }
        const double hh = f / (h + h);
        for (size_t j = 0; j < i; j++) {
            const double fj = A(i, j), gj = e[j] - hh * fj;
            e[j] = gj;
            for (size_t k = 0; k <= j; k++) A(j, k) -= fj * e[k] + gj * A(i, k);
        }
        d[i] = h;
    }
    // accumulate the reflections
    d[0] = e[0] = 0;
    for (size_t i = 0; i < n; i++) {
        if (d[i] != 0) {
            memset(work, 0, i * sizeof *work);
            for (size_t k = 0; k < i; k++) add_scaled(i, A(i, k), &A(k, 0), work);
            for (size_t k = 0; k < i; k++) add_scaled(i, -A(k, i), work, &A(k, 0));
        }
        d[i] = A(i, i);
        A(i, i) = 1;
        for (size_t j = 0; j < i; j++) A(j, i) = A(i, j) = 0;
    }
#undef A
}

/* Implicit QL iteration on d[n], e[n]. The eigenvectors are rows of v (the literature has columns),
   so that each plane rotation runs along memory. Returns 1 if an eigenvalue needs more than 60
   iterations. */
static int ql_iterate(size_t n, double *d, double *e, double *v)
{
    for (size_t i = 1; i < n; i++) e[i - 1] = e[i];
    e[n - 1] = 0;
    for (size_t l = 0; l < n; l++) {
        for (int iteration = 0;; iteration++) {
            // split at a negligible sub-diagonal element
            size_t m = l;
            for (; m + 1 < n; m++) {
                const double dd = fabs(d[m]) + fabs(d[m + 1]);
                if (fabs(e[m]) <= 1.1e-16 * dd) break;
            }
            if (m == l) break;
            if (iteration == 60) return 1;
            // implicit shift from the leading 2 x 2 block
            double g = (d[l + 1] - d[l]) / (2 * e[l]), r = hypot(g, 1), s = 1, c = 1, p = 0;
            g = d[m] - d[l] + e[l] / (g + copysign(r, g));
            size_t i = m;
            for (; i-- > l;) {
                double f = s * e[i];
                const double b = c * e[i];
                e[i + 1] = r = hypot(f, g);
                if (!(r > 0)) {
                    d[i + 1] -= p;
                    e[m] = 0;
                    break;
                }
                // rotation of rows i and i + 1 of the tridiagonal matrix
                s = f / r, c = g / r;
                g = d[i + 1] - p;
                r = (d[i] - g) * s + 2 * c * b;
                p = s * r;
                d[i + 1] = g + p;
                g = c * r - b;
                // rotate two eigenvectors
                double *low = v + i * n, *high = low + n;
                for (size_t k = 0; k < n; k++) {
                    f = high[k];
                    high[k] = s * low[k] + c * f;
                    low[k] = c * low[k] - s * f;
                }
            }
            if (!(r > 0) && i + 1 > l) continue;
            d[l] -= p;
            e[l] = g;
            e[m] = 0;
        }
    }
    return 0;
}

sdm_status trainer_eigen_symmetric(size_t n, double *a, double *values, sdm_error *err)
{
    double *e = NULL;
    sdm_status s = SDM_ALLOC(&e, 2 * n, "eigenvalues", err);
    if (s) return s;
    tridiagonalise(n, a, values, e, e + n);
    // transpose: ql_iterate() expects rows
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < i; j++) {
            const double t = a[i * n + j];
            a[i * n + j] = a[j * n + i];
            a[j * n + i] = t;
        }
    }
    if (ql_iterate(n, values, e, a))
        s = sdm_fail(err, SDM_E_INTERNAL, "eigenvalues of a %zu x %zu matrix did not converge", n,
                     n);
    sdm_free(e);
    // sort in descending order; selection sort costs little beside the O(n^3) above
    for (size_t i = 0; i < n && !s; i++) {
        size_t best = i;
        for (size_t j = i + 1; j < n; j++)
            if (values[j] > values[best]) best = j;
        if (best == i) continue;
        const double t = values[i];
        values[i] = values[best];
        values[best] = t;
        for (size_t k = 0; k < n; k++) {
            const double u = a[i * n + k];
            a[i * n + k] = a[best * n + k];
            a[best * n + k] = u;
        }
    }
    return s;
}

size_t trainer_cholesky(size_t n, double *a)
{
    for (size_t i = 0; i < n; i++) {
        double *ai = a + i * n;
        for (size_t j = 0; j <= i; j++) {
            const double *aj = a + j * n;
            const double s = ai[j] - dot(j, ai, aj);
            if (j < i)
                ai[j] = s / aj[j];
            else if (s > 0)
                ai[i] = sqrt(s);
            else
                return i + 1;
        }
    }
    return 0;
}

void trainer_cholesky_solve(size_t n, const double *l, size_t columns, double *b)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++) {
            const double f = l[i * n + k];
            for (size_t c = 0; c < columns; c++) b[i * columns + c] -= f * b[k * columns + c];
        }
        for (size_t c = 0; c < columns; c++) b[i * columns + c] /= l[i * n + i];
    }
    // backward substitution with the transposed factor
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) {
            const double f = l[k * n + i];
            for (size_t c = 0; c < columns; c++) b[i * columns + c] -= f * b[k * columns + c];
        }
        for (size_t c = 0; c < columns; c++) b[i * columns + c] /= l[i * n + i];
    }
}

/* inverse[k][k] = inverse of the lower triangular l[k][k], as float; column[k] is
   scratch memory. */
static void invert_lower(size_t k, const double *l, double *column, float *inverse)
{
    memset(inverse, 0, k * k * sizeof *inverse);
    for (size_t j = 0; j < k; j++) {
        for (size_t i = j; i < k; i++) {
            column[i] = ((i == j) - dot(i - j, l + i * k + j, column + j)) / l[i * k + i];
            inverse[i * k + j] = (float)column[i];
        }
    }
}

/* Cholesky QR, `rounds` times. Each round reduces the linear dependence of the rows (condition
   number) by a factor of about 1000. */
static sdm_status orthonormalise_rounds(size_t k, size_t n, float *x, int rounds, int n_threads,
                                        sdm_error *err)
{
    float *gram = NULL, *old = NULL;
    double *l = NULL, *column = NULL;
    sdm_status s = SDM_ALLOC(&gram, k * k, "orthonormal rows", err);
    if (!s) s = SDM_ALLOC(&old, k * n, "orthonormal rows", err);
    if (!s) s = SDM_ALLOC(&l, k * k, "orthonormal rows", err);
    if (!s) s = SDM_ALLOC(&column, k, "orthonormal rows", err);
    for (int round = 0; round < rounds && !s; round++) {
        // scale the rows to length 1: the shift below is then relative to each row
        for (size_t i = 0; i < k; i++) {
            double norm = 0;
            for (size_t j = 0; j < n; j++) norm += (double)x[i * n + j] * x[i * n + j];
            const float f = norm > 0 ? (float)(1 / sqrt(norm)) : 0.0f;
            for (size_t j = 0; j < n; j++) x[i * n + j] *= f;
        }
        sdm_gemm(k, k, n, (sdm_view){x, n, 1}, (sdm_view){x, 1, n}, false, gram, k, n_threads);
        // Gram matrix + shift * identity, with a shift that grows until the factor exists
        for (double shift = round < 3 ? 1e-6 * (double)k : 0; !s;
             shift = shift > 0 ? shift * 100 : 1e-7 * (double)k) {
            for (size_t i = 0; i < k * k; i++) l[i] = gram[i];
            for (size_t i = 0; i < k; i++) l[i * k + i] += shift;
            if (!trainer_cholesky(k, l)) break;
            if (shift > 1e6)
                s = sdm_fail(err, SDM_E_INTERNAL,
                             "%zu rows of %zu numbers cannot be made orthonormal", k, n);
        }
        if (s) break;
        // rows = inverse factor * rows
        invert_lower(k, l, column, gram);
        memcpy(old, x, k * n * sizeof *x);
        sdm_gemm(k, n, k, (sdm_view){gram, k, 1}, (sdm_view){old, n, 1}, false, x, n, n_threads);
    }
    sdm_free(column);
    sdm_free(l);
    sdm_free(old);
    sdm_free(gram);
    return s;
}

enum { ROUNDS = 4 };

sdm_status trainer_orthonormalise(size_t k, size_t n, float *x, int n_threads, sdm_error *err)
{
    return orthonormalise_rounds(k, n, x, ROUNDS, n_threads, err);
}

static void random_rows(size_t count, uint64_t seed, uint64_t stream, float *x)
{
    for (size_t i = 0; i < count; i++) x[i] = (float)(sdm_rng_uniform(seed, stream, i) - 0.5);
}

/* SMALL: rows of a matrix of which more than half of the eigenvectors are computed sooner by
 * computing all of them. */
enum { OVERSAMPLING = 8, ITERATIONS = 6, SMALL = 128 };

/* basis[k][n], values[k] = the first k eigenvectors and eigenvalues of c[n][n], of which all are
 * computed. */
static sdm_status all_eigenvectors(size_t n, const float *c, size_t k, float *basis, double *values,
                                   sdm_error *err)
{
    double *a = NULL, *all = NULL;
    sdm_status s = SDM_ALLOC(&a, n * n, "eigenvectors", err);
    if (!s) s = SDM_ALLOC(&all, n, "eigenvectors", err);
    for (size_t i = 0; i < n && !s; i++)
        for (size_t j = 0; j < n; j++) a[i * n + j] = 0.5 * ((double)c[i * n + j] + c[j * n + i]);
    if (!s) s = trainer_eigen_symmetric(n, a, all, err);
    for (size_t i = 0; i < k * n && !s; i++) basis[i] = (float)a[i];
    if (!s) memcpy(values, all, k * sizeof *values);
    sdm_free(all);
    sdm_free(a);
    return s;
}

sdm_status trainer_leading_eigenvectors(size_t n, const float *c, size_t k, uint64_t seed,
                                        uint64_t stream, float *basis, double *values,
                                        sdm_error *err)
{
    if (n <= SMALL && 2 * k > n) return all_eigenvectors(n, c, k, basis, values, err);
    const size_t wide = k + OVERSAMPLING < n ? k + OVERSAMPLING : n;
    float *x = NULL, *y = NULL, *small = NULL;
    double *ritz = NULL, *all = NULL;
    sdm_status s = SDM_ALLOC(&x, wide * n, "eigenvectors", err);
    if (!s) s = SDM_ALLOC(&y, wide * n, "eigenvectors", err);
    if (!s) s = SDM_ALLOC(&small, wide * wide, "eigenvectors", err);
    if (!s) s = SDM_ALLOC(&ritz, wide * wide, "eigenvectors", err);
    if (!s) s = SDM_ALLOC(&all, wide, "eigenvectors", err);
    if (s) goto done;
    // subspace iteration
    random_rows(wide * n, seed, stream, x);
    for (int i = 0; i < ITERATIONS && !s; i++) {
        sdm_gemm(wide, n, n, (sdm_view){x, n, 1}, (sdm_view){c, n, 1}, false, y, n, 1);
        memcpy(x, y, wide * n * sizeof *x);
        s = orthonormalise_rounds(wide, n, x, i + 1 < ITERATIONS ? ROUNDS / 2 : ROUNDS, 1, err);
    }
    if (s) goto done;
    // Rayleigh-Ritz: eigenvectors of the covariance within the subspace
    sdm_gemm(wide, n, n, (sdm_view){x, n, 1}, (sdm_view){c, n, 1}, false, y, n, 1);
    sdm_gemm(wide, wide, n, (sdm_view){y, n, 1}, (sdm_view){x, 1, n}, false, small, wide, 1);
    for (size_t i = 0; i < wide; i++)
        for (size_t j = 0; j < wide; j++)
            ritz[i * wide + j] = 0.5 * ((double)small[i * wide + j] + small[j * wide + i]);
    if ((s = trainer_eigen_symmetric(wide, ritz, all, err))) goto done;
    // expand the k leading eigenvectors to n dimensions
    for (size_t i = 0; i < wide * wide; i++) small[i] = (float)ritz[i];
    sdm_gemm(k, n, wide, (sdm_view){small, wide, 1}, (sdm_view){x, n, 1}, false, basis, n, 1);
    memcpy(values, all, k * sizeof *values);
done:
    sdm_free(all);
    sdm_free(ritz);
    sdm_free(small);
    sdm_free(y);
    sdm_free(x);
    return s;
}

/* to[k][n] = from[k][m] times a[m][n]; each rank computes some of the rows. */
static sdm_status shared_product(sdm_comm *comm, size_t k, size_t n, size_t m, const float *from,
                                 sdm_view a, float *to, int n_threads, sdm_error *err)
{
    const sdm_comm_part own = sdm_comm_own(comm, k);
    sdm_gemm(own.end - own.first, n, m, (sdm_view){from + own.first * m, m, 1}, a, false,
             to + own.first * n, n, n_threads);
    return sdm_comm_gather_shares(comm, to, k, n * sizeof *to, err);
}

sdm_status trainer_leading_space(sdm_comm *comm, size_t m, size_t n, const float *y, size_t k,
                                 uint64_t seed, uint64_t stream, int n_threads, float *rows,
                                 sdm_error *err)
{
    const sdm_view values = {y, n, 1}, transposed = {y, 1, n};
    float *left = NULL;
    sdm_status s = SDM_ALLOC(&left, k * m, "global modes", err);
    if (s) return s;
    random_rows(k * n, seed, stream, rows);
    for (int i = 0; i < 4 && !s; i++) {
        s = shared_product(comm, k, m, n, rows, transposed, left, n_threads, err);
        if (!s) s = orthonormalise_rounds(k, m, left, ROUNDS / 2, n_threads, err);
        if (!s) s = shared_product(comm, k, n, m, left, values, rows, n_threads, err);
        if (!s)
            s = orthonormalise_rounds(k, n, rows, i + 1 < 4 ? ROUNDS / 2 : ROUNDS, n_threads, err);
    }
    sdm_free(left);
    return s;
}
