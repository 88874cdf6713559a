/* Linear algebra of the trainer (eigenvectors, factorisations, orthonormal bases) and its
 * quasi-random samples, against their definitions.
 * Tests: linalg.c sampling.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "numerics/linalg.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/sampling.h"
#include "sdm/internal/team.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

static void eigenvectors_satisfy_their_equation(void **state)
{
    (void)state;
    const size_t sizes[] = {1, 2, 3, 40};
    for (size_t t = 0; t < 4; t++) {
        const size_t n = sizes[t];
        double *a, *v, *a0;
        assert_int_equal(SDM_ALLOC(&a, n * n, "a", NULL), 0);
        assert_int_equal(SDM_ALLOC(&a0, n * n, "a", NULL), 0);
        assert_int_equal(SDM_ALLOC(&v, n, "v", NULL), 0);
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j <= i; j++)
                a0[i * n + j] = a0[j * n + i] = sdm_rng_normal(1, t, i * n + j);
        memcpy(a, a0, n * n * sizeof *a);
        assert_int_equal(trainer_eigen_symmetric(n, a, v, NULL), 0);
        for (size_t i = 0; i < n; i++) {
            if (i) assert_true(v[i] <= v[i - 1]);
            for (size_t j = 0; j < n; j++) {
                double applied = 0, dot = 0;
                for (size_t k = 0; k < n; k++)
                    applied += a0[j * n + k] * a[i * n + k], dot += a[i * n + k] * a[j * n + k];
                assert_true(fabs(applied - v[i] * a[i * n + j]) < 1e-12 * (double)n);
                assert_true(fabs(dot - (i == j)) < 1e-12 * (double)n);
            }
        }
        sdm_free(a);
        sdm_free(a0);
        sdm_free(v);
    }
    // already diagonal, with repeated zeros
    double diagonal[9] = {2, 0, 0, 0, 3, 0, 0, 0, 1}, values[3];
    assert_int_equal(trainer_eigen_symmetric(3, diagonal, values, NULL), 0);
    assert_true(values[0] == 3 && values[1] == 2 && values[2] == 1);
}

static void solutions_satisfy_the_system(void **state)
{
    (void)state;
    enum { N = 20 };
    double m[N][N], a[N * N], b[2 * N], x[2 * N];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) m[i][j] = sdm_rng_normal(2, 1, (uint64_t)(i * N + j));
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            a[i * N + j] = i == j;
            for (int k = 0; k < N; k++) a[i * N + j] += m[i][k] * m[j][k];
        }
    for (int i = 0; i < 2 * N; i++) x[i] = sdm_rng_normal(2, 2, (uint64_t)i);
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 2; c++) {
            b[2 * i + c] = 0;
            for (int j = 0; j < N; j++) b[2 * i + c] += a[i * N + j] * x[2 * j + c];
        }
    assert_int_equal(trainer_cholesky(N, a), 0);
    trainer_cholesky_solve(N, a, 2, b);
    for (int i = 0; i < 2 * N; i++) assert_true(fabs(b[i] - x[i]) < 1e-9);
    double indefinite[4] = {1, 2, 2, 1};
    assert_int_equal(trainer_cholesky(2, indefinite), 2);
}

static void leading_spaces_are_found(void **state)
{
    (void)state;
    enum { N = 60, K = 12, MOST = 31 }; // MOST: more than half
    // A covariance matrix with known eigenvectors: eigenvalues 0.6^k in a rotated basis.
    float *q, *c, *basis;
    double values[MOST];
    assert_int_equal(SDM_ALLOC(&q, N * N, "q", NULL), 0);
    assert_int_equal(SDM_ALLOC(&c, N * N, "c", NULL), 0);
    assert_int_equal(SDM_ALLOC(&basis, N * N, "b", NULL), 0);
    for (size_t i = 0; i < N * N; i++) q[i] = (float)sdm_rng_normal(4, 1, i);
    assert_int_equal(trainer_orthonormalise(N, N, q, 1, NULL), 0);
    for (size_t i = 0; i < N; i++)
        for (size_t j = 0; j < N; j++) {
            double s = 0;
            for (size_t k = 0; k < N; k++)
                s += (double)q[k * N + i] * q[k * N + j] * pow(0.6, (double)k);
            c[i * N + j] = (float)s;
        }
    for (size_t n = K; n <= MOST; n += MOST - K) {
        assert_int_equal(trainer_leading_eigenvectors(N, c, n, 1, 2, basis, values, NULL), 0);
        for (size_t k = 0; k < K; k++) {
            assert_true(fabs(values[k] / pow(0.6, (double)k) - 1) < 1e-3);
            double along = 0;
            for (size_t i = 0; i < N; i++) along += (double)basis[k * N + i] * q[k * N + i];
            assert_true(fabs(fabs(along) - 1) < 1e-3);
        }
    }
    // Rows of very different size, one of them zero: the orthonormal basis spans the same space.
    float *rows, *one, *two;
    assert_int_equal(SDM_ALLOC(&rows, 8 * N, "r", NULL), 0);
    for (size_t i = 0; i < 7 * N; i++)
        rows[i] = (float)(sdm_rng_normal(4, 5, i) * pow(10, (double)(i / N) - 4));
    assert_int_equal(trainer_orthonormalise(7, N, rows, 1, NULL), 0);
    for (size_t i = 0; i < 7; i++)
        for (size_t j = 0; j < 7; j++) {
            double dot = 0;
            for (size_t k = 0; k < N; k++) dot += (double)rows[i * N + k] * rows[j * N + k];
            assert_true(fabs(dot - (i == j)) < 1e-5);
        }
    // Any number of threads gives the same bits.
    assert_int_equal(SDM_ALLOC(&one, K * N, "1", NULL), 0);
    assert_int_equal(SDM_ALLOC(&two, K * N, "2", NULL), 0);
    assert_int_equal(trainer_leading_space(NULL, N, N, c, K, 9, 0, 1, one, NULL), 0);
    sdm_team *team;
    assert_int_equal(sdm_team_start(3, &team, NULL), 0);
    assert_int_equal(trainer_leading_space(NULL, N, N, c, K, 9, 0, 3, two, NULL), 0);
    sdm_team_end(team);
    assert_memory_equal(one, two, K * N * sizeof *one);
    sdm_free(q);
    sdm_free(c);
    sdm_free(basis);
    sdm_free(rows);
    sdm_free(one);
    sdm_free(two);
}

enum { D = 64 };
static sdm_distribution uniform[D];

// Component d of a point without the digital shift: its bits against those of point 0.
static void point_bits(uint64_t index, size_t n, uint32_t bits[D])
{
    double low[D] = {0}, high[D], p[D], zero[D];
    for (size_t d = 0; d < n; d++) high[d] = 0x1p32;
    sdm_sample_params(7, 1, index, low, high, uniform, n, p);
    sdm_sample_params(7, 1, 0, low, high, uniform, n, zero);
    for (size_t d = 0; d < n; d++) bits[d] = (uint32_t)p[d] ^ (uint32_t)zero[d];
}

// Each of the 2^d boxes that halve every dimension holds the same number of the first points of a
// Sobol' sequence, also after the digital shift. In every dimension each of N slices holds one of
// any N points that begin at a multiple of N, a power of two.
static void samples_are_stratified(void **state)
{
    (void)state;
    enum { N = 1024 };
    const double min[D] = {0};
    double max[D], p[D];
    int in_box[16] = {0};
    static int in_slice[D][N];
    for (size_t d = 0; d < D; d++) max[d] = 1;
    for (uint64_t i = 0; i < N; i++) {
        sdm_sample_params(7, 1, i, min, max, uniform, 4, p);
        in_box[(p[0] >= 0.5) + 2 * (p[1] >= 0.5) + 4 * (p[2] >= 0.5) + 8 * (p[3] >= 0.5)]++;
        sdm_sample_params(7, 1, 3 * N + i, min, max, uniform, D, p);
        for (size_t d = 0; d < D; d++) in_slice[d][(int)(p[d] * N)]++;
    }
    for (int b = 0; b < 16; b++) assert_int_equal(in_box[b], 64);
    for (size_t d = 0; d < D; d++)
        for (int s = 0; s < N; s++) assert_int_equal(in_slice[d][s], 1);
}

// The points are those of the published direction numbers: fingerprints of points 1 to 1023 (FNV-1a
// over their 32-bit fractions), from an implementation of its own that read the table of Joe and
// Kuo as SciPy and Commons Math ship it. The first 16 dimensions must never change: models are
// trained again from their configurations.
static void points_are_those_of_joe_and_kuo(void **state)
{
    (void)state;
    const struct {
        size_t from, to;
        uint64_t wanted;
    } parts[] = {{0, 16, 0x9c68588e478431e5}, {16, 64, 0xee4a8d9439473f65}};
    for (size_t k = 0; k < 2; k++) {
        uint64_t found = 0xcbf29ce484222325;
        for (uint64_t i = 1; i < 1024; i++) {
            uint32_t bits[D];
            point_bits(i, parts[k].to, bits);
            for (size_t d = parts[k].from; d < parts[k].to; d++)
                found = (found ^ bits[d]) * 0x100000001b3;
        }
        assert_true(found == parts[k].wanted);
    }
}

// Normal samples stay in their range, have the moments of the truncated distribution, and lie at
// the quantiles of the uniform ones.
static void samples_follow_their_distribution(void **state)
{
    (void)state;
    enum { N = 4096, P = 20 };
    double lo[P], hi[P], x[P], unit[P], sum[P] = {0}, square[P] = {0};
    const double zero[P] = {0};
    double one[P];
    sdm_distribution normal[P];
    for (int d = 0; d < P; d++) {
        lo[d] = -3, hi[d] = 3, one[d] = 1;
        normal[d] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0, 1};
    }
    for (uint64_t i = 0; i < N; i++) {
        sdm_sample_params(7, 2, i, lo, hi, normal, P, x);
        sdm_sample_params(7, 2, i, zero, one, uniform, P, unit);
        for (int d = 0; d < P; d++) {
            const double a = 0.5 * erfc(3 / sqrt(2)), below = 0.5 * erfc(-x[d] / sqrt(2));
            assert_true(x[d] >= -3 && x[d] <= 3);
            assert_true(fabs((below - a) / (1 - 2 * a) - unit[d]) < 1e-14);
            sum[d] += x[d] / N, square[d] += x[d] * x[d] / N;
        }
    }
    // variance of a standard normal distribution cut at 3: 1 - 6 density(3) / probability
    const double variance = 1 - 6 * exp(-4.5) / sqrt(2 * acos(-1)) / erf(3 / sqrt(2));
    for (int d = 0; d < P; d++)
        assert_true(fabs(sum[d]) < 1e-3 && fabs(square[d] - variance) < 2e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(eigenvectors_satisfy_their_equation),
                                       cmocka_unit_test(solutions_satisfy_the_system),
                                       cmocka_unit_test(leading_spaces_are_found),
                                       cmocka_unit_test(samples_are_stratified),
                                       cmocka_unit_test(points_are_those_of_joe_and_kuo),
                                       cmocka_unit_test(samples_follow_their_distribution)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
