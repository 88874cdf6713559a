/* sdm_model_vjp() of the template network against its Jacobian and against central differences of
 * its maps.
 * Tests: template_corner_slopes.c template_reverse.c template_reverse_blocks.c
 * template_warp_slopes.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "template_toys.h"

// The toys of template_toys.h; then the ellipsoid and the bent sphere with a correction.
enum { CASES = TOYS + 2 };

typedef struct network {
    toy t;
    sdm_model *m;
    uint8_t *correction;
    size_t voxels;
    double tolerance;
} network;

static network network_new(int which, const sdm_grid *grid)
{
    const int base = which < TOYS ? which : which - TOYS + 1;
    network n = {.t = make(base, grid), .tolerance = TOLERANCE[base]};
    if (which >= TOYS) {
        n.correction = correction_build(&n.t, &n.t.spec.correction_size);
        n.t.spec.correction = n.correction;
    }
    n.m = toy_open(&n.t);
    n.voxels = sdm_grid_count(grid);
    return n;
}

static void network_dispose(network *n)
{
    sdm_model_free(n->m);
    sdm_free(n->correction);
    toy_dispose(&n->t);
}

static float *map_new(size_t voxels)
{
    float *map = NULL;
    assert_int_equal(SDM_ALLOC(&map, voxels, "map", NULL), SDM_OK);
    return map;
}

// Computed twice, in memory that holds other numbers before: the same bits.
static void product(const sdm_model *m, const double *p, const float *adjoint, double gradient[P])
{
    const size_t bytes = sdm_model_vjp_scratch_bytes(m);
    uint8_t *scratch = NULL;
    double again[P];
    assert_int_equal(SDM_ALLOC(&scratch, bytes, "scratch", NULL), SDM_OK);
    memset(scratch, 0xa5, bytes);
    sdm_model_vjp(m, p, adjoint, gradient, scratch);
    memset(scratch, 0x3c, bytes);
    sdm_model_vjp(m, p, adjoint, again, scratch);
    assert_memory_equal(gradient, again, sizeof again);
    sdm_free(scratch);
}

static void random_point(const toy *t, uint64_t i, double p[P])
{
    for (uint64_t k = 0; k < P; k++)
        p[k] = t->params[k].min +
               (t->params[k].max - t->params[k].min) * (0.1 + 0.8 * sdm_rng_uniform(21, i, k));
}

// gradient = the transposed Jacobian times the adjoint. The tolerance is relative to the size of a
// sum of such terms with random signs.
static void check_product(const slopes *s, const float *adjoint, const double gradient[P])
{
    for (size_t k = 0; k < P; k++) {
        double sum = 0, squares = 0;
        for (size_t v = 0; v < s->voxels; v++) {
            const double term = (double)adjoint[v] * (double)s->jacobian[k * s->voxels + v];
            sum += term;
            squares += term * term + 0.01 * (double)(adjoint[v] * adjoint[v]);
        }
        if (!(fabs(gradient[k] - sum) <= 1e-5 * sqrt(squares)))
            fail_msg("parameter %zu: %.9g, not %.9g; terms %g", k, gradient[k], sum, sqrt(squares));
    }
}

static void product_is_that_with_the_jacobian(void **state)
{
    (void)state;
    for (int which = 0; which < CASES; which++)
        for (int g = 0; g < GRIDS; g++) {
            const sdm_grid grid = toy_grid(g);
            network n = network_new(which, &grid);
            float *adjoint = map_new(n.voxels);
            for (uint64_t i = 0; i < 3; i++) {
                double p[P], gradient[P];
                random_point(&n.t, i, p);
                for (size_t v = 0; v < n.voxels; v++) adjoint[v] = (float)sdm_rng_normal(22, i, v);
                slopes s = slopes_of(n.m, p);
                product(n.m, p, adjoint, gradient);
                check_product(&s, adjoint, gradient);
                slopes_dispose(&s);
            }
            sdm_free(adjoint);
            network_dispose(&n);
        }
}

// An adjoint of one voxel gives a row of the Jacobian; an adjoint of zeros gives zeros.
static void single_voxels_give_rows_of_the_jacobian(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(2);
    for (int which = 0; which < CASES; which++) {
        network n = network_new(which, &grid);
        float *adjoint = map_new(n.voxels);
        double p[P], gradient[P];
        random_point(&n.t, 7, p);
        slopes s = slopes_of(n.m, p);
        product(n.m, p, adjoint, gradient);
        for (int k = 0; k < P; k++) assert_true(gradient[k] == 0);
        for (size_t v = (size_t)which; v < n.voxels; v += 37) {
            adjoint[v] = -2.5f;
            product(n.m, p, adjoint, gradient);
            for (size_t k = 0; k < P; k++) {
                const double expected = -2.5 * (double)s.jacobian[k * n.voxels + v];
                if (!(fabs(gradient[k] - expected) <= 2e-5 * (1 + fabs(expected))))
                    fail_msg("voxel %zu: %.9g, not %.9g", v, gradient[k], expected);
            }
            adjoint[v] = 0;
        }
        slopes_dispose(&s);
        sdm_free(adjoint);
        network_dispose(&n);
    }
}

// Along a random direction, with random weights of the voxels.
static void check_difference(const network *n, uint64_t i)
{
    const double step = 0.005;
    double p[P], low[P], high[P], gradient[P], direction[P], found = 0, truth = 0, squares = 0;
    float *adjoint = map_new(n->voxels);
    random_point(&n->t, i, p);
    for (uint64_t k = 0; k < P; k++) {
        direction[k] = sdm_rng_normal(24, i, k);
        low[k] = p[k] - step * direction[k];
        high[k] = p[k] + step * direction[k];
    }
    for (size_t v = 0; v < n->voxels; v++) {
        const bool jumps =
            n->t.spec.n_parts > 1 && nearest(&n->t, low, v) != nearest(&n->t, high, v);
        adjoint[v] = jumps ? 0 : (float)sdm_rng_normal(23, i, v);
    }
    product(n->m, p, adjoint, gradient);
    for (int k = 0; k < P; k++) found += direction[k] * gradient[k];
    float *before = toy_map(n->m, low, 1), *after = toy_map(n->m, high, 1);
    for (size_t v = 0; v < n->voxels; v++) {
        const double slope = ((double)after[v] - (double)before[v]) / (2 * step);
        truth += (double)adjoint[v] * slope;
        squares += (double)(adjoint[v] * adjoint[v]) * (1 + fabs(slope)) * (1 + fabs(slope));
    }
    if (!(fabs(found - truth) <= n->tolerance * sqrt(squares)))
        fail_msg("%g, not %g; terms %g", found, truth, sqrt(squares));
    sdm_free(adjoint), sdm_free(before), sdm_free(after);
}

static void product_is_the_slope_of_the_map(void **state)
{
    (void)state;
    for (int which = 0; which < CASES; which++)
        for (int g = 0; g < 4; g++) {
            const sdm_grid grid = toy_grid(g);
            network n = network_new(which, &grid);
            for (uint64_t i = 0; i < 4; i++) check_difference(&n, i);
            network_dispose(&n);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(product_is_that_with_the_jacobian),
                                       cmocka_unit_test(single_voxels_give_rows_of_the_jacobian),
                                       cmocka_unit_test(product_is_the_slope_of_the_map)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
