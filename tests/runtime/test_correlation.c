/* Autocorrelation of residuals: noise of known correlation, after a least-squares fit has removed
 * part of it.
 * Tests: correlation.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/trust/correlation.h"
#include "sdm/internal/rng.h"

#define PI 3.14159265358979324

enum { NX = 26, NY = 24, NZ = 7, VOXELS = NX * NY * NZ, REACH = 4, UNKNOWNS = 12, FITS = 12 };

// A Gaussian kernel (variance 1) that turns white noise into noise of variance 1; the constant is
// the sum of exp(-k^2).
static double kernel(int k) { return exp(-0.5 * k * k) / sqrt(1.7726372048266521); }

// e: white noise, smoothed by the kernel along each axis.
static void smooth_noise(uint64_t seed, double *e)
{
    enum { WX = NX + 2 * REACH, WY = NY + 2 * REACH, WZ = NZ + 2 * REACH };
    static double a[WX * WY * WZ], b[WX * WY * WZ];
    const int step[3] = {1, WX, WX * WY}, n[3] = {WX, WY, WZ};
    for (uint64_t i = 0; i < WX * WY * WZ; i++) a[i] = sdm_rng_normal(seed, 7, i);
    for (int axis = 0; axis < 3; axis++) {
        for (int i = 0; i < WX * WY * WZ; i++) {
            const int at = i / step[axis] % n[axis];
            b[i] = 0;
            for (int k = -REACH; k <= REACH; k++)
                if (at + k >= 0 && at + k < n[axis]) b[i] += kernel(k) * a[i + k * step[axis]];
        }
        memcpy(a, b, sizeof a);
    }
    for (int i = 0; i < VOXELS; i++)
        e[i] = a[i % NX + REACH + (i / NX % NY + REACH) * WX + (i / NX / NY + REACH) * WX * WY];
}

// The functions fitted (root) are cosines, orthogonal on the voxels; influence: the inverse of
// their Gram matrix.
static void make_neighbours(fit_neighbours *v, double *influence)
{
    *v = (fit_neighbours){.n = VOXELS, .n_unknowns = UNKNOWNS, .size = {NX, NY, NZ}, .step = 1};
    v->number_at = calloc(VOXELS, sizeof *v->number_at);
    v->position = calloc(3 * VOXELS, sizeof *v->position);
    v->draw = calloc(VOXELS, sizeof *v->draw);
    v->residual = calloc(VOXELS, sizeof *v->residual);
    v->weight = calloc(VOXELS, sizeof *v->weight);
    v->root = calloc(VOXELS * UNKNOWNS, sizeof *v->root);
    if (!v->number_at || !v->position || !v->draw || !v->residual || !v->weight || !v->root)
        abort();
    memset(influence, 0, UNKNOWNS * UNKNOWNS * sizeof *influence);
    for (int i = 0; i < VOXELS; i++) {
        const int p[3] = {i % NX, i / NX % NY, i / NX / NY};
        for (int k = 0; k < 3; k++) v->position[3 * i + k] = p[k];
        v->number_at[i] = (uint32_t)i + 1;
        v->draw[i] = (float)sdm_rng_uniform(3, 4, (uint64_t)i);
        v->weight[i] = 1;
        for (int a = 0; a < UNKNOWNS; a++)
            v->root[UNKNOWNS * i + a] = (float)(cos(PI * (p[0] + 0.5) * (a % 4) / NX) *
                                                cos(PI * (p[1] + 0.5) * (a / 4) / NY));
    }
    for (int a = 0; a < UNKNOWNS; a++) {
        double sum = 0;
        for (int i = 0; i < VOXELS; i++)
            sum += (double)v->root[UNKNOWNS * i + a] * (double)v->root[UNKNOWNS * i + a];
        influence[a * (UNKNOWNS + 1)] = 1 / sum;
    }
}

static void free_neighbours(fit_neighbours *v)
{
    free(v->number_at);
    free(v->position);
    free(v->draw);
    free(v->residual);
    free(v->weight);
    free(v->root);
}

// Residuals of e after a least-squares fit of the cosines.
static void cosines_fit(fit_neighbours *v, const double *influence, const double *e)
{
    double x[UNKNOWNS];
    for (int a = 0; a < UNKNOWNS; a++) {
        x[a] = 0;
        for (int i = 0; i < VOXELS; i++)
            x[a] += influence[a * (UNKNOWNS + 1)] * (double)v->root[UNKNOWNS * i + a] * e[i];
    }
    for (int i = 0; i < VOXELS; i++) {
        double r = e[i];
        for (int a = 0; a < UNKNOWNS; a++) r -= (double)v->root[UNKNOWNS * i + a] * x[a];
        v->residual[i] = (float)r;
    }
}

static void test_correction_recovers_the_sum(void **state)
{
    (void)state;
    static double e[VOXELS], influence[UNKNOWNS * UNKNOWNS], c[FIT_LAG_ZERO + 1],
        weighted[FIT_LAG_ZERO + 1];
    double sum = 0, square = 0, before = 0, after = 0, variance = 0, spread = 0, freedom = 0;
    fit_neighbours v;
    make_neighbours(&v, influence);
    for (int k = -REACH; k <= REACH; k++) sum += kernel(k), square += kernel(k) * kernel(k);
    const double wanted = pow(sum * sum / square, 3);
    for (uint64_t seed = 0; seed < FITS; seed++) {
        int width;
        smooth_noise(seed, e);
        cosines_fit(&v, influence, e);
        double of_one;
        assert_int_equal(sdm_fit_correlation_estimate(&v, 1, 1, c, &width, &of_one, NULL), SDM_OK);
        before += sdm_fit_correlation_taper(c, width, true, weighted) / FITS;
        freedom += of_one / FITS;
        assert_int_equal(sdm_fit_correlation_correct(&v, influence, width, 1, c, NULL), SDM_OK);
        const double found = sdm_fit_correlation_taper(c, width, true, weighted);
        after += found / FITS;
        spread += (found - wanted) * (found - wanted) / FITS;
        variance += c[FIT_LAG_ZERO] / FITS;
    }
    printf("sum of correlations %.1f: %.1f of residuals, %.1f freed; variance %.3f, relative "
           "variance of the sum %.3f, by the degrees of freedom %.3f\n",
           wanted, before, after, variance, spread / (wanted * wanted), 2 / freedom);
    assert_true(before < 0.75 * wanted);
    assert_true(fabs(after / wanted - 1) < 0.12);
    assert_true(fabs(variance - 1) < 0.05);
    // a sum of twelve squares is within a factor of 2.5 of its mean in 99 % of all cases
    const double ratio = spread / (wanted * wanted) * 0.5 * freedom;
    assert_true(ratio > 0.4 && ratio < 2.5);
    free_neighbours(&v);
}

// Any number of threads gives the same bits.
static void test_same_bits_for_threads(void **state)
{
    (void)state;
    static double e[VOXELS], influence[UNKNOWNS * UNKNOWNS], c[2][FIT_LAG_ZERO + 1];
    fit_neighbours v;
    make_neighbours(&v, influence);
    smooth_noise(1, e);
    cosines_fit(&v, influence, e);
    for (int i = 0; i < 2; i++) {
        int width;
        double freedom;
        assert_int_equal(
            sdm_fit_correlation_estimate(&v, 0.2, 1 + 2 * i, c[i], &width, &freedom, NULL), SDM_OK);
        assert_int_equal(sdm_fit_correlation_correct(&v, influence, width, 1 + 2 * i, c[i], NULL),
                         SDM_OK);
    }
    assert_memory_equal(c[0], c[1], sizeof c[0]);
    free_neighbours(&v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_correction_recovers_the_sum),
                                       cmocka_unit_test(test_same_bits_for_threads)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
