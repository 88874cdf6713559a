/* Derivatives of the template network against central differences of its maps, and its correction
 * by a pod network.
 * Tests: template_corner_slopes.c template_slope_rows.c template_slopes.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "template_toys.h"

static void check_slopes(const toy *t, const sdm_model *m, double tolerance)
{
    const double step = 0.01;
    for (uint64_t i = 0; i < 2; i++) {
        const double p[P] = {-0.5 + (double)i, 3 + 1.7 * (double)i};
        slopes s = slopes_of(m, p);
        float *map = toy_map(m, p, 1);
        assert_memory_equal(s.map, map, s.voxels * sizeof *map);
        size_t left_out = 0;
        for (int k = 0; k < P; k++) {
            double low[P], high[P];
            memcpy(low, p, sizeof low), memcpy(high, p, sizeof high);
            low[k] -= step, high[k] += step;
            float *before = toy_map(m, low, 1), *after = toy_map(m, high, 1);
            for (size_t v = 0; v < s.voxels; v++) {
                const double truth = ((double)after[v] - (double)before[v]) / (2 * step),
                             found = (double)s.jacobian[(size_t)k * s.voxels + v];
                if (fabs(found - truth) <= tolerance * (1 + fabs(truth))) continue;
                const bool jumps = t->spec.n_parts > 1 && nearest(t, low, v) != nearest(t, high, v);
                left_out += jumps;
                if (!jumps) fail_msg("voxel %zu, parameter %d: %g, not %g", v, k, found, truth);
            }
            sdm_free(before), sdm_free(after);
        }
        assert_true(left_out < s.voxels / 20 + 1);
        sdm_free(map);
        slopes_dispose(&s);
    }
}

static void jacobian_is_the_slope(void **state)
{
    (void)state;
    for (int which = 0; which < TOYS; which++)
        for (int g = 0; g < GRIDS; g++) {
            const sdm_grid grid = toy_grid(g);
            toy t = make(which, &grid);
            sdm_model *m = toy_open(&t);
            check_slopes(&t, m, TOLERANCE[which]);
            sdm_model_free(m);
            toy_dispose(&t);
        }
}

static void products_use_the_jacobian(void **state)
{
    (void)state;
    const double p[P] = {0.7, 4.4}, direction[P] = {0.6, -1.3};
    for (int which = 0; which < TOYS; which++) {
        const sdm_grid grid = toy_grid(1);
        toy t = make(which, &grid);
        sdm_model *m = toy_open(&t);
        slopes s = slopes_of(m, p);
        float *map = NULL, *tangent = NULL, *adjoint = NULL;
        void *scratch = NULL;
        assert_int_equal(SDM_ALLOC(&map, s.voxels, "map", NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&tangent, s.voxels, "map", NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&adjoint, s.voxels, "map", NULL), SDM_OK);
        assert_int_equal(sdm_alloc(&scratch, sdm_model_jvp_scratch_bytes(m), 1, "scratch", NULL),
                         SDM_OK);
        sdm_model_jvp(m, p, direction, map, tangent, scratch);
        sdm_free(scratch);
        assert_memory_equal(map, s.map, s.voxels * sizeof *map);
        double gradient[P], expected[P] = {0};
        for (size_t v = 0; v < s.voxels; v++) {
            double sum = 0;
            adjoint[v] = (float)sdm_rng_normal(4, 4, v);
            for (size_t k = 0; k < P; k++) {
                const double slope = (double)s.jacobian[k * s.voxels + v];
                sum += direction[k] * slope;
                expected[k] += (double)adjoint[v] * slope;
            }
            assert_true(fabs((double)tangent[v] - sum) < 1e-5 * (1 + fabs(sum)));
        }
        assert_int_equal(sdm_alloc(&scratch, sdm_model_vjp_scratch_bytes(m), 1, "scratch", NULL),
                         SDM_OK);
        sdm_model_vjp(m, p, adjoint, gradient, scratch);
        sdm_free(scratch);
        for (int k = 0; k < P; k++)
            assert_true(fabs(gradient[k] - expected[k]) < 1e-4 * (1 + fabs(expected[k])));
        sdm_free(map), sdm_free(tangent), sdm_free(adjoint);
        slopes_dispose(&s);
        sdm_model_free(m);
        toy_dispose(&t);
    }
}

static void correction_is_added(void **state)
{
    (void)state;
    for (int which = 1; which <= 2; which++) {
        const sdm_grid grid = toy_grid(0);
        toy t = make(which, &grid);
        sdm_model *plain = toy_open(&t);
        size_t size;
        uint8_t *bytes = correction_build(&t, &size);
        t.spec.correction = bytes;
        t.spec.correction_size = size;
        sdm_model *m = toy_open(&t);
        assert_true(sdm_model_get_info(m)->macs > sdm_model_get_info(plain)->macs);
        const double p[P] = {1.2, 3.1};
        float *without = toy_map(plain, p, 1), *with = toy_map(m, p, 1);
        for (size_t v = 0; v < sdm_grid_count(&grid); v++) {
            double x[3], y[3];
            voxel_world(&grid, v, x);
            toy_carry_back(&t, p, 0, x, y);
            toy_unwarp(&t, p, 0, 0, y);
            for (int a = 0; a < 3; a++) y[a] = fmin(fmax(y[a], -12), 12);
            const double scaled = 2 * (p[0] - t.params[0].min) / 3 - 1,
                         truth = dot3(LINEAR, y) * (1 + scaled);
            // three voxels away from the surface warps are interpolated, by the distance
            const bool far = which == 2 && fmaxf(fabsf(with[v]), fabsf(without[v])) > 3 * 0.5f;
            if (!(fabs((double)(with[v] - without[v]) - truth) < (far ? 5e-2 : 2e-3)))
                fail_msg("voxel %zu: %g, not %g", v, (double)(with[v] - without[v]), truth);
        }
        check_slopes(&t, m, TOLERANCE[which]);
        sdm_free(with), sdm_free(without);
        sdm_model_free(m);
        sdm_model_free(plain);
        sdm_free(bytes);
        toy_dispose(&t);
    }
}

static void wrong_correction_is_refused(void **state)
{
    (void)state;
    const sdm_grid grid = toy_grid(1);
    for (int wrong = 0; wrong < 4; wrong++) {
        toy t = make(wrong == 1 ? 0 : 2, &grid);
        size_t size;
        uint8_t *bytes = correction_build(&t, &size), *file;
        t.spec.correction = bytes;
        t.spec.correction_size = size;
        if (wrong == 0) t.params[1].max += 1;           // another range
        if (wrong == 2) t.spec.correction_size -= 1000; // a part of the file
        if (wrong == 3) t.spec.correction_size = 0;     // wrong == 1: several parts
        sdm_error e = {0};
        sdm_model *m;
        size_t file_size;
        assert_int_equal(toy_build(&t, &file, &file_size, &e), SDM_OK);
        assert_int_equal(sdm_model_open_memory("wrong", file, file_size, &m, &e), SDM_E_FORMAT);
        assert_non_null(strstr(e.text, "correction"));
        assert_null(m);
        sdm_free(file);
        sdm_free(bytes);
        toy_dispose(&t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(jacobian_is_the_slope), cmocka_unit_test(products_use_the_jacobian),
        cmocka_unit_test(correction_is_added), cmocka_unit_test(wrong_correction_is_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
