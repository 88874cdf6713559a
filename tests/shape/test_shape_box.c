/* The box of a family of shapes against closed forms and against random shapes.
 * Tests: shape_box.c shape_family.c sampling.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/shape_box.h"
#include "shapes/shape_tools.h"

static void box_of(const sdm_instance *s, const double (*range)[2], size_t samples, double low[3],
                   double high[3])
{
    sdm_error err = {0};
    if (sdm_shape_box(s, range, samples, 1, low, high, &err)) fail_msg("%s", err.text);
}

// A torus about z with radii R and r reaches R + r in x and y, and r in z.
static void test_torus(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("torus", "edge=0.1");
    size_t n;
    const sdm_param *p = sdm_instance_params(s, &n);
    assert_int_equal(n, 2);
    const double range[2][2] = {{3, 4}, {0.5, 1}};
    double low[3], high[3];
    for (int own = 0; own < 2; own++) {
        const double R = own ? p[0].max : 4, r = own ? p[1].max : 1;
        box_of(s, own ? NULL : range, 0, low, high);
        for (int i = 0; i < 3; i++) {
            const double reach = i < 2 ? R + r : r;
            assert_true(fabs(high[i] - reach) < 0.01 && fabs(low[i] + reach) < 0.01);
        }
    }
    sdm_instance_free(s);
}

// No random shape of a family leaves its box by more than a small part of its size.
static void holds(const char *shape, const char *options, double part)
{
    sdm_instance *s = shape_make(shape, options);
    double low[3], high[3], again[2][3], p[16], out = 0, size = 0;
    box_of(s, NULL, 128, low, high);
    box_of(s, NULL, 128, again[0], again[1]);
    assert_memory_equal(low, again[0], sizeof low);
    assert_memory_equal(high, again[1], sizeof high);
    for (int i = 0; i < 3; i++) size = fmax(size, high[i] - low[i]);
    sdm_mesh m = {0};
    for (int k = 0; k < 200; k++) {
        random_params(s, p);
        mesh_at(s, p, &m);
        for (size_t i = 0; i < 3 * m.n_vert; i++)
            out = fmax(out, fmax(low[i % 3] - m.vert[i], m.vert[i] - high[i % 3]));
    }
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
    if (out > part * size) fail_msg("%s leaves its box by %g of %g mm", shape, out, size);
}

static void test_random_shapes(void **state)
{
    (void)state;
    holds("ellipsoid", "edge=0.4", 0);
    holds("cochlea", "edge=0.5", 0.01);
    holds("linkage", "links=4", 0.01);
    holds("linkage", "links=8", 0.01); // 8 parameters: random corners
}

// A point-like triangle mesh that moves along x by the sum of its parameters.
static int sum_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 3, 1);
    if (failed) return failed;
    double x = 0;
    for (int i = 0; i < 9; i++) x += p[i];
    for (int v = 0; v < 3; v++) {
        out->tri[v] = (uint32_t)v;
        out->vert[3 * v] = x;
        out->vert[3 * v + 1] = v == 1;
        out->vert[3 * v + 2] = v == 2;
    }
    return 0;
}

static void all_normal(const void *self, sdm_distribution *out)
{
    (void)self;
    for (int i = 0; i < 9; i++) out[i] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0, 1};
}

// Nine uniform parameters reach the far corner of their ranges nearly; nine normal ones stay within
// some deviations of their sum, which is 3.
static void test_many_parameters(void **state)
{
    (void)state;
    static char names[9][3];
    static sdm_param params[9];
    for (int i = 0; i < 9; i++) {
        snprintf(names[i], sizeof names[i], "p%d", i);
        params[i] = (sdm_param){names[i], "", -3, 3, 0, ""};
    }
    sdm_shape shape = {.abi = SDM_SHAPE_ABI,
                       .size = sizeof shape,
                       .name = "sum",
                       .summary = "moves by the sum of its parameters",
                       .params = params,
                       .n_params = 9,
                       .mesh = sum_mesh};
    double low[3], high[3];
    for (int normal = 0; normal < 2; normal++) {
        shape.distributions = normal ? all_normal : NULL;
        sdm_instance *s = NULL;
        assert_int_equal(sdm_instance_create(&shape, NULL, 0, NULL, &s, NULL), SDM_OK);
        box_of(s, NULL, 256, low, high);
        if (normal)
            assert_true(high[0] > 6 && high[0] < 13 && low[0] < -6 && low[0] > -13);
        else
            assert_true(high[0] >= 15 && high[0] <= 27 && low[0] <= -15 && low[0] >= -27);
        sdm_instance_free(s);
    }
}

static void test_refused(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("torus", "");
    const double wide[2][2] = {{-1, 4}, {0.5, 1}}, empty[2][2] = {{4, 3}, {0.5, 1}};
    double low[3] = {7, 7, 7}, high[3] = {7, 7, 7};
    sdm_error err = {0};
    assert_int_equal(sdm_shape_box(s, wide, 4, 1, low, high, &err), SDM_E_RANGE);
    assert_int_equal(sdm_shape_box(s, empty, 4, 1, low, high, &err), SDM_E_RANGE);
    assert_int_equal(sdm_shape_box(NULL, NULL, 4, 1, low, high, &err), SDM_E_ARG);
    for (int i = 0; i < 3; i++) assert_true(low[i] == 7 && high[i] == 7);
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_torus),
        cmocka_unit_test(test_random_shapes),
        cmocka_unit_test(test_many_parameters),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
