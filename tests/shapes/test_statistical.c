/* The statistical shape: models read from files, and every way in which files can contradict each
 * other.
 * Tests: statistical.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/image.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sdm/meshfile.h"

#ifndef MODEL_FOLDER
#define MODEL_FOLDER "model"         /* folder with the output of make_model */
#define LABYRINTH_FOLDER "labyrinth" /* folder with the output of make_labyrinth */
#endif
#define N_VERT 6

static sdm_registry *registry;
static const sdm_shape *shape;
static sdm_error err;

static void write_array(const char *path, const float *values, size_t n0, size_t n1, size_t n2)
{
    const size_t size[3] = {n0, n1, n2};
    assert_int_equal(sdm_npy_write(path, values, size, n1 ? n2 ? 3 : 2 : 1, &err), SDM_OK);
}

// Writes the model files: an octahedron and three modes whose numbers are multiples of 1/8, so that
// sums are exact.
static int set_up(void **state)
{
    (void)state;
    if (sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL)) return 1;
    shape = sdm_registry_find(registry, "statistical", NULL);
    double vert[3 * N_VERT] = {2, 0, 0, -2, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 2, 0, 0, -2};
    uint32_t tri[24] = {0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5};
    const sdm_mesh m = {.vert = vert, .tri = tri, .n_vert = N_VERT, .n_tri = 8};
    float modes[3 * 3 * N_VERT];
    for (int i = 0; i < 3 * 3 * N_VERT; i++) modes[i] = (float)(i % 7 - 3) / 8;
    const float deviations[3] = {2, 1, 0.5f};
    if (sdm_mesh_write("statistical_mean.ply", &m, NULL)) return 1;
    write_array("statistical_modes.npy", modes, 3, N_VERT, 3);
    write_array("statistical_flat.npy", modes, 3, 3 * N_VERT, 0);
    write_array("statistical_short.npy", modes, 3, N_VERT - 1, 3);
    write_array("statistical_thirds.npy", modes, 3, 3 * N_VERT - 1, 0);
    write_array("statistical_line.npy", modes, 9, 0, 0);
    write_array("statistical_pairs.npy", modes, 3, N_VERT, 2);
    write_array("statistical_deviations.npy", deviations, 3, 0, 0);
    write_array("statistical_two.npy", deviations, 2, 0, 0);
    const float bad[3] = {1, 0, 1};
    write_array("statistical_zero.npy", bad, 3, 0, 0);
    modes[20] = NAN;
    write_array("statistical_nan.npy", modes, 3, N_VERT, 3);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    sdm_registry_free(registry);
    return 0;
}

// Creates an instance. modes, deviations: the middle part of the names of the files; NULL omits an
// option.
static sdm_status statistical_make(const char *modes, const char *deviations, const char *count,
                                   const char *limit, sdm_instance **out)
{
    char files[2][64];
    sdm_named_text given[5] = {{"mean", "statistical_mean.ply"}};
    size_t n = 1;
    snprintf(files[0], sizeof files[0], "statistical_%s.npy", modes ? modes : "");
    snprintf(files[1], sizeof files[1], "statistical_%s.npy", deviations ? deviations : "");
    if (modes) given[n++] = (sdm_named_text){"modes", files[0]};
    if (deviations) given[n++] = (sdm_named_text){"deviations", files[1]};
    if (count) given[n++] = (sdm_named_text){"count", count};
    if (limit) given[n++] = (sdm_named_text){"limit", limit};
    *out = NULL;
    return sdm_instance_create(shape, given, n, ".", out, &err);
}

static double mean_number(size_t i)
{
    static const double MEAN[3 * N_VERT] = {2, 0,  0, -2, 0, 0, 0, 2, 0,
                                            0, -2, 0, 0,  0, 2, 0, 0, -2};
    return MEAN[i];
}

static double mode_number(size_t mode, size_t i)
{
    return ((double)((mode * 3 * N_VERT + i) % 7) - 3) / 8;
}

static void test_mesh_is_mean_plus_modes(void **state)
{
    (void)state;
    static const char *const MODES[] = {"modes", "flat"};
    static const double DEVIATIONS[] = {2, 1, 0.5}, P[3] = {1.5, -0.5, 2};
    for (int flat = 0; flat < 2; flat++)
        for (int scaled = 0; scaled < 2; scaled++) {
            sdm_instance *s = NULL;
            assert_int_equal(
                statistical_make(MODES[flat], scaled ? "deviations" : NULL, NULL, NULL, &s),
                SDM_OK);
            size_t n = 0;
            const sdm_param *params = sdm_instance_params(s, &n);
            assert_int_equal(n, 3);
            assert_string_equal(params[2].name, "m3");
            assert_string_equal(params[2].unit, "sd");
            assert_true(params[1].min == -3 && params[1].max == 3 && params[1].def == 0);
            const sdm_distribution *d = sdm_instance_distributions(s);
            for (size_t k = 0; k < 3; k++)
                assert_true(d[k].kind == SDM_DISTRIBUTION_NORMAL && d[k].mean == 0 &&
                            d[k].deviation == 1);
            sdm_mesh m = {0};
            double v[3 * 3 * N_VERT];
            assert_int_equal(sdm_instance_mesh(s, P, &m, &err), SDM_OK);
            assert_int_equal(sdm_instance_velocity(s, P, N_VERT, v, &err), SDM_OK);
            assert_int_equal(m.n_vert, N_VERT);
            assert_int_equal(m.n_tri, 8);
            for (size_t i = 0; i < 3 * N_VERT; i++) {
                double expected = mean_number(i);
                for (size_t k = 0; k < 3; k++) {
                    const double mode = mode_number(k, i) * (scaled ? DEVIATIONS[k] : 1);
                    expected += P[k] * mode;
                    assert_true(v[3 * N_VERT * k + i] == mode);
                }
                assert_true(m.vert[i] == expected);
            }
            assert_int_equal(sdm_instance_velocity(s, P, N_VERT - 1, v, &err), SDM_E_PLUGIN);
            sdm_mesh_dispose(&m);
            sdm_instance_free(s);
        }
}

static void test_count_and_limit(void **state)
{
    (void)state;
    sdm_instance *s = NULL;
    assert_int_equal(statistical_make("modes", NULL, "2", "1.5", &s), SDM_OK);
    size_t n = 0;
    const sdm_param *params = sdm_instance_params(s, &n);
    assert_int_equal(n, 2);
    assert_true(params[0].min == -1.5 && params[0].max == 1.5);
    const double p[2] = {0, 1.6};
    assert_int_equal(sdm_instance_check(s, p, &err), SDM_E_RANGE);
    assert_string_equal(err.text,
                        "shape 'statistical': parameter 'm2' = 1.6 sd, allowed -1.5 .. 1.5 sd");
    sdm_instance_free(s);
}

static void test_contradictory_files_are_refused(void **state)
{
    (void)state;
    static const char *const BAD[][4] = {
        {NULL, NULL, NULL, "option 'modes' is missing"},
        {"short", NULL, NULL,
         "statistical_short.npy: has modes of 5 vertices, but the mean ./statistical_mean.ply has "
         "6"},
        {"thirds", NULL, NULL,
         "statistical_thirds.npy: has 17 numbers a mode, need a multiple of 3"},
        {"line", NULL, NULL,
         "statistical_line.npy: has 1 dimensions, need [modes][vertices][3] or [modes][3 "
         "vertices]"},
        {"pairs", NULL, NULL, "statistical_pairs.npy: has 3 dimensions, need"},
        {"nan", NULL, NULL, "statistical_nan.npy: number 20 is not finite"},
        {"modes", NULL, "4", "statistical_modes.npy: has 3 modes, count = 4 asks for more"},
        {"modes", "two", NULL,
         "statistical_two.npy: has 2 numbers in 1 dimensions, need one for each of the 3 modes of "
         "./statistical_modes.npy"},
        {"modes", "modes", NULL, "need one for each of the 3 modes"},
        {"modes", "zero", NULL, "statistical_zero.npy: standard deviation 1 is 0, need > 0"},
        {"missing", NULL, NULL, "statistical_missing.npy"},
    };
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        sdm_instance *s = NULL;
        assert_int_equal(statistical_make(BAD[i][0], BAD[i][1], BAD[i][2], NULL, &s), SDM_E_PLUGIN);
        assert_null(s);
        assert_memory_equal(err.text, "shape 'statistical': ", 21);
        if (!strstr(err.text, BAD[i][3])) fail_msg("'%s' is not in '%s'", BAD[i][3], err.text);
    }
    sdm_instance *s = NULL;
    assert_int_equal(sdm_instance_create(shape, NULL, 0, NULL, &s, &err), SDM_E_PLUGIN);
    assert_non_null(strstr(err.text, "option 'mean' is missing"));
    const sdm_named_text none[] = {{"mean", "/there/is/none.ply"}, {"modes", "x.npy"}};
    assert_int_equal(sdm_instance_create(shape, none, 2, NULL, &s, &err), SDM_E_PLUGIN);
    assert_non_null(strstr(err.text, "/there/is/none.ply"));
}

// More modes than a shape may have parameters: refused unless the option `count` limits them.
static void test_many_modes(void **state)
{
    (void)state;
    static float many[70][3 * N_VERT];
    for (size_t i = 0; i < 70; i++) many[i][i % (3 * N_VERT)] = 1;
    write_array("statistical_many.npy", many[0], 70, 3 * N_VERT, 0);
    sdm_instance *s = NULL;
    assert_int_equal(statistical_make("many", NULL, NULL, NULL, &s), SDM_E_PLUGIN);
    assert_non_null(strstr(err.text, "has 70 modes, at most 64 can be used: set count"));
    assert_int_equal(statistical_make("many", NULL, "64", NULL, &s), SDM_OK);
    size_t n = 0;
    assert_string_equal(sdm_instance_params(s, &n)[63].name, "m64");
    sdm_instance_free(s);
}

// The model of examples/statistical: a valid mesh with all parameters at two standard deviations,
// and orthonormal modes.
static void test_example(void **state)
{
    (void)state;
    enum { MODES = 8 };
    const sdm_named_text given[] = {
        {"mean", "mean.ply"}, {"modes", "modes.npy"}, {"deviations", "deviations.npy"}};
    sdm_instance *s = NULL;
    if (sdm_instance_create(shape, given, 3, MODEL_FOLDER, &s, &err)) fail_msg("%s", err.text);
    size_t n = 0;
    sdm_instance_params(s, &n);
    assert_int_equal(n, MODES);
    sdm_mesh m = {0};
    for (int corner = 0; corner < 1 << MODES; corner++) {
        double p[MODES];
        for (int i = 0; i < MODES; i++) p[i] = corner >> i & 1 ? 2 : -2;
        sdm_audit a;
        assert_int_equal(sdm_instance_mesh(s, p, &m, &err), SDM_OK);
        assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_OK);
        assert_true(a.manifold && !a.inverted && a.components == 1);
        assert_int_equal(a.self_intersections, 0);
        for (int k = 0; k < 3; k++)
            assert_true(a.max[k] - a.min[k] > 2 && a.max[k] - a.min[k] < 12);
    }
    double *v = NULL;
    const double zero[MODES] = {0};
    assert_int_equal(SDM_ALLOC(&v, MODES * 3 * m.n_vert, "velocities", &err), SDM_OK);
    assert_int_equal(sdm_instance_velocity(s, zero, m.n_vert, v, &err), SDM_OK);
    for (size_t i = 0; i < MODES; i++)
        for (size_t j = 0; j <= i; j++) {
            double dot = 0;
            for (size_t k = 0; k < 3 * m.n_vert; k++)
                dot += v[3 * m.n_vert * i + k] * v[3 * m.n_vert * j + k] / (double)m.n_vert;
            assert_true(fabs(dot - (i == j ? 0.0625 * pow(0.5625, (double)i) : 0)) < 1e-12);
        }
    sdm_free(v);
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

static sdm_instance *labyrinth_make(const char *folder)
{
    const sdm_named_text given[] = {{"mean", "mean.ply"}, {"modes", "modes.npy"}, {"limit", "2.5"}};
    sdm_instance *s = NULL;
    if (sdm_instance_create(shape, given, 3, folder, &s, &err)) fail_msg("%s", err.text);
    return s;
}

// The model of configs/labyrinth: it is what make_labyrinth writes, its meshes are solids with
// three handles that do not meet themselves, and it has the variance of its Gaussian process.
static void test_labyrinth(void **state)
{
    (void)state;
    enum { MODES = 24 };
    sdm_instance *shipped = labyrinth_make(SDM_SOURCE_FOLDER "/configs/labyrinth"),
                 *made = labyrinth_make(LABYRINTH_FOLDER);
    sdm_mesh m = {0}, other = {0};
    uint64_t draw = 0;
    for (int round = 0; round < 12; round++) {
        double p[MODES];
        for (int i = 0; i < MODES; i++) {
            do p[i] = sdm_rng_normal(11, 1, draw++);
            while (fabs(p[i]) > 2.5);
        }
        sdm_audit a;
        assert_int_equal(sdm_instance_mesh(shipped, p, &m, &err), SDM_OK);
        assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_OK);
        assert_true(a.manifold && !a.inverted);
        assert_int_equal(a.components, 1);
        assert_int_equal(a.degenerate + a.self_intersections, 0);
        assert_int_equal(m.n_tri, 2 * m.n_vert + 8); // genus 3: Euler characteristic -4
        assert_int_equal(sdm_instance_mesh(made, p, &other, &err), SDM_OK);
        assert_int_equal(other.n_vert, m.n_vert);
        assert_memory_equal(other.tri, m.tri, 3 * m.n_tri * sizeof *m.tri);
        for (size_t i = 0; i < 3 * m.n_vert; i++)
            assert_true(fabs(other.vert[i] - m.vert[i]) < 1e-4);
    }
    // The variances of all modes add up to most of that of the process, 0.49 mm^2.
    const double zero[MODES] = {0};
    double *v = NULL;
    assert_int_equal(SDM_ALLOC(&v, MODES * 3 * m.n_vert, "velocities", &err), SDM_OK);
    assert_int_equal(sdm_instance_velocity(shipped, zero, m.n_vert, v, &err), SDM_OK);
    for (size_t i = 0; i < m.n_vert; i++) {
        double variance[3] = {0};
        for (size_t k = 0; k < MODES * 3; k++)
            variance[k % 3] += pow(v[k / 3 * 3 * m.n_vert + 3 * i + k % 3], 2);
        for (int k = 0; k < 3; k++) assert_true(variance[k] > 0.3 && variance[k] < 0.4901);
    }
    sdm_free(v);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&other);
    sdm_instance_free(shipped);
    sdm_instance_free(made);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mesh_is_mean_plus_modes),
        cmocka_unit_test(test_count_and_limit),
        cmocka_unit_test(test_contradictory_files_are_refused),
        cmocka_unit_test(test_many_modes),
        cmocka_unit_test(test_example),
        cmocka_unit_test(test_labyrinth),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
