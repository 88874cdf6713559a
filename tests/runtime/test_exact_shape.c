/* Derivatives of exact maps with respect to shape parameters: against closed forms and differences
 * of exact distances, on grids and at points.
 * Tests: exact_shape.c point_slopes.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_tools.h"
#include "oracle/shape_registry.h"
#include "sdm/internal/exact_slopes.h"
#include "sdm/internal/heap.h"
#include "sdm/runtime.h"

static sdm_instance *shape_make(const sdm_shape *shape, const char *option, const char *value)
{
    sdm_instance *s = NULL;
    sdm_error err = {0};
    if (sdm_instance_create(shape, &(sdm_named_text){option, value}, option != NULL, NULL, &s,
                            &err))
        fail_msg("%s", err.text);
    return s;
}

static sdm_exact *engine_at(const sdm_instance *s, const double *p, const sdm_exact_opts *o)
{
    sdm_error err = {0};
    sdm_mesh m = {0};
    if (sdm_instance_mesh(s, p, &m, &err)) fail_msg("%s", err.text);
    sdm_exact *e = engine(&m, o);
    sdm_mesh_dispose(&m);
    return e;
}

static float *jacobian_at(const sdm_instance *s, const double *p, const sdm_exact_opts *o,
                          const sdm_grid *g, float *values)
{
    sdm_error err = {0};
    size_t n;
    (void)sdm_instance_params(s, &n);
    float *j = room(n * sdm_grid_count(g), sizeof *j);
    sdm_exact_report report = {0};
    if (sdm_exact_shape_jacobian(s, p, o, g, values, j, &report, &err)) fail_msg("%s", err.text);
    assert_true(report.n_tri_used > 0);
    return j;
}

/* slopes[n][n_params] = derivatives at the voxel centres of the grid, as points; NaN at a point
 * that has no answer, which is checked here. */
static double *slopes_at_points(const sdm_instance *s, const double *p, const sdm_exact *e,
                                const sdm_grid *g)
{
    sdm_error err = {0};
    size_t n_params;
    (void)sdm_instance_params(s, &n_params);
    const size_t n = sdm_grid_count(g) + 1;
    sdm_mesh mesh = {0};
    if (sdm_instance_mesh(s, p, &mesh, &err)) fail_msg("%s", err.text);
    double *velocity = room(3 * mesh.n_vert * n_params, sizeof *velocity),
           *x = room(10 * n, sizeof *x), *slopes = room(n * n_params, sizeof *slopes);
    uint32_t *triangle = room(n, sizeof *triangle);
    if (sdm_instance_velocity(s, p, mesh.n_vert, velocity, &err)) fail_msg("%s", err.text);
    const sdm_exact_at at = {x + 3 * n, x + 4 * n, x + 7 * n, triangle};
    for (size_t i = 0; i + 1 < n; i++) position(g, i, x + 3 * i);
    x[3 * n - 3] = NAN, x[3 * n - 2] = 0, x[3 * n - 1] = 0;
    sdm_exact_slopes *of = NULL;
    if (sdm_exact_points(e, x, n, &at, &err)) fail_msg("%s", err.text);
    if (sdm_exact_slopes_create(e, velocity, n_params, &of, &err)) fail_msg("%s", err.text);
    for (size_t i = 0; i < n; i++)
        sdm_exact_slopes_at(of, x + 3 * i, &at, i, slopes + i * n_params);
    for (size_t k = 0; k < n_params; k++) assert_true(isnan(slopes[(n - 1) * n_params + k]));
    sdm_exact_slopes_free(of);
    sdm_mesh_dispose(&mesh);
    free(triangle);
    free(x);
    free(velocity);
    return slopes;
}

/* Where forward and backward differences agree, the distance is smooth and the derivative must
 * lie between them. At least a share `wanted` of the voxels must be smooth. */
static void check_differences(const sdm_instance *s, const double *p, const sdm_exact_opts *o,
                              const sdm_grid *g, double wanted)
{
    size_t n_params, smooth = 0;
    const sdm_param *params = sdm_instance_params(s, &n_params);
    const size_t n = sdm_grid_count(g);
    float *values = room(n, sizeof *values), *j = jacobian_at(s, p, o, g, values);
    sdm_exact *here = engine_at(s, p, o);
    double *at_points = slopes_at_points(s, p, here, g);
    for (size_t k = 0; k < n_params; k++) {
        const double range = params[k].max - params[k].min, h = 2e-6 * range;
        double q[8];
        memcpy(q, p, n_params * sizeof *q);
        q[k] = p[k] + h;
        sdm_exact *behind = engine_at(s, q, o);
        q[k] = p[k] - h;
        sdm_exact *before = engine_at(s, q, o);
        for (size_t i = 0; i < n; i++) {
            double x[3];
            position(g, i, x);
            const double d = sdm_exact_point(here, x, NULL, NULL, NULL);
            const double forward = (sdm_exact_point(behind, x, NULL, NULL, NULL) - d) / h;
            const double backward = (d - sdm_exact_point(before, x, NULL, NULL, NULL)) / h;
            assert_true(values[i] == (float)d);
            if (fabs(forward - backward) * range > 2e-3) continue;
            smooth++;
            if (!(fabs((double)j[k * n + i] - 0.5 * (forward + backward)) * range < 3e-3))
                fail_msg("%s, voxel %zu at (%g %g %g), distance %g: %g, differences %g and %g",
                         params[k].name, i, x[0], x[1], x[2], d, (double)j[k * n + i], backward,
                         forward);
            const double slope = at_points[i * n_params + k];
            if (!(fabs(slope - 0.5 * (forward + backward)) * range < 3e-3))
                fail_msg("%s, point (%g %g %g), distance %g: %g, differences %g and %g",
                         params[k].name, x[0], x[1], x[2], d, slope, backward, forward);
        }
        sdm_exact_free(before);
        sdm_exact_free(behind);
    }
    assert_true((double)smooth > wanted * (double)(n * n_params));
    sdm_exact_free(here);
    free(at_points);
    free(values);
    free(j);
}

static void test_derivatives_of_cochlea(void **state)
{
    (void)state;
    sdm_instance *s = shape_make(sdm_registry_find(registry, "cochlea", NULL), NULL, NULL);
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    double p[8];
    for (size_t k = 0; k < n; k++) p[k] = params[k].def + 0.1 * (params[k].min - params[k].def);
    const sdm_grid g = sdm_grid_centred((int64_t[3]){22, 20, 14}, 0.5, (double[3]){0.01, 0.02, 2});
    sdm_exact *e = engine_at(s, p, NULL);
    assert_true(sdm_exact_get_report(e)->unioned);
    sdm_exact_free(e);
    check_differences(s, p, NULL, &g, 0.97);
    check_differences(s, p, &(sdm_exact_opts){.keep_overlap = true}, &g, 0.97);
    sdm_instance_free(s);
}

static void test_derivatives_of_superquadric(void **state)
{
    (void)state;
    sdm_instance *s = shape_make(sdm_registry_find(registry, "ellipsoid", NULL), "e1", "0.4");
    const sdm_grid g =
        sdm_grid_centred((int64_t[3]){17, 15, 13}, 0.61, (double[3]){0.01, 0.02, 0.03});
    check_differences(s, (double[3]){3.9, 2.8, 2.1}, NULL, &g, 0.95);
    sdm_instance_free(s);
}

/* Derivatives of ideal shapes; the bounds allow for the angle between triangles and surface. */
static void test_derivatives_in_closed_form(void **state)
{
    (void)state;
    const sdm_grid g =
        sdm_grid_centred((int64_t[3]){15, 14, 13}, 0.8, (double[3]){0.01, 0.02, 0.03});
    const size_t n = sdm_grid_count(&g);
    sdm_instance *ball = shape_make(sdm_registry_find(registry, "ellipsoid", NULL), "edge", "0.1");
    float *j = jacobian_at(ball, (double[3]){3, 3, 3}, NULL, &g, NULL);
    // Changing all three semi-axes together changes the radius, whose derivative is -1.
    for (size_t i = 0; i < n; i++)
        assert_true(fabs((double)j[i] + (double)j[n + i] + (double)j[2 * n + i] + 1) < 1e-3);
    free(j);
    sdm_instance_free(ball);

    sdm_instance *torus = shape_make(sdm_registry_find(registry, "torus", NULL), "edge", "0.05");
    j = jacobian_at(torus, (double[2]){3, 1.2}, NULL, &g, NULL);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        position(&g, i, x);
        const double across = hypot(x[0], x[1]) - 3, middle = hypot(across, x[2]);
        assert_true(fabs((double)j[n + i] + 1) < 2e-3);
        // The nearest triangle may be a neighbour of the right one: the normal turns by 0.05 / 1.2
        // across an edge.
        if (middle > 0.1 && across > -2.9) assert_true(fabs((double)j[i] + across / middle) < 0.05);
    }
    free(j);
    sdm_instance_free(torus);

    sdm_instance *capsule =
        shape_make(sdm_registry_find(registry, "capsule", NULL), "edge", "0.05");
    j = jacobian_at(capsule, (double[2]){1.5, 4}, NULL, &g, NULL);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        position(&g, i, x);
        const double beyond = fmax(fabs(x[2]) - 2, 0),
                     wanted = -0.5 * beyond / hypot(hypot(x[0], x[1]), beyond);
        assert_true(fabs((double)j[i] + 1) < 2e-3);
        assert_true(fabs((double)j[n + i] - wanted) < 0.03);
    }
    free(j);
    sdm_instance_free(capsule);
}

/* Without a velocity callback the registry takes finite differences of the mesh, one-sided at
 * the ends of a range. */
static void test_derivatives_without_velocity(void **state)
{
    (void)state;
    const sdm_shape *with = sdm_registry_find(registry, "cochlea", NULL);
    sdm_shape without = *with;
    without.velocity = NULL;
    sdm_instance *a = shape_make(with, NULL, NULL), *b = shape_make(&without, NULL, NULL);
    const sdm_grid g = sdm_grid_centred((int64_t[3]){9, 9, 9}, 1.1, (double[3]){0.01, 0.02, 2});
    size_t n;
    const sdm_param *params = sdm_instance_params(a, &n);
    for (int end = 0; end < 3; end++) {
        double p[8];
        for (size_t k = 0; k < n; k++)
            p[k] = end == 0 ? params[k].def : end == 1 ? params[k].min : params[k].max;
        float *ja = jacobian_at(a, p, NULL, &g, NULL), *jb = jacobian_at(b, p, NULL, &g, NULL);
        for (size_t i = 0; i < n * sdm_grid_count(&g); i++)
            assert_true(fabs((double)ja[i] - (double)jb[i]) < 2e-6 * (1 + fabs((double)ja[i])));
        free(ja);
        free(jb);
    }
    sdm_instance_free(a);
    sdm_instance_free(b);
}

static void test_same_bits_for_threads(void **state)
{
    (void)state;
    sdm_instance *s = shape_make(sdm_registry_find(registry, "cochlea", NULL), NULL, NULL);
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    double p[8];
    for (size_t k = 0; k < n; k++) p[k] = params[k].def;
    const sdm_grid g = sdm_grid_centred((int64_t[3]){20, 19, 18}, 0.5, (double[3]){0, 0, 2});
    float *one = jacobian_at(s, p, &(sdm_exact_opts){.n_threads = 1}, &g, NULL);
    for (int n_threads = 2; n_threads <= 3; n_threads++) {
        float *more = jacobian_at(s, p, &(sdm_exact_opts){.n_threads = n_threads}, &g, NULL);
        assert_memory_equal(one, more, n * sdm_grid_count(&g) * sizeof *one);
        free(more);
    }
    free(one);
    sdm_instance_free(s);
}

/* ---- wrong arguments ---- */

// A tetrahedron with one more (unused) vertex if size >= 2: the number of vertices must not depend
// on parameters.
static int growing_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    static const uint32_t tri[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    (void)self, (void)options;
    const int failed = host->reserve(host, out, p[0] > 2 ? 5 : 4, 4);
    if (failed) return failed;
    memset(out->vert, 0, 3 * out->n_vert * sizeof *out->vert);
    for (int k = 0; k < 3; k++) out->vert[3 * (k + 1) + k] = p[0];
    memcpy(out->tri, tri, sizeof tri);
    return 0;
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    static const sdm_param size = {"size", "mm", 1, 3, 2, "edge"};
    const sdm_shape growing = {.abi = SDM_SHAPE_ABI,
                               .size = sizeof growing,
                               .name = "growing",
                               .summary = "number of vertices depends on the size",
                               .params = &size,
                               .n_params = 1,
                               .mesh = growing_mesh};
    sdm_error err = {0};
    sdm_instance *s = shape_make(&growing, NULL, NULL);
    sdm_grid g = sdm_grid_centred((int64_t[3]){4, 4, 4}, 0.3, (double[3]){0.3, 0.3, 0.3});
    float values[64], j[64];
    const double at = 2, fine = 1.5, outside = 4;
    assert_int_equal(sdm_exact_shape_jacobian(s, &fine, NULL, &g, values, j, NULL, &err), SDM_OK);
    assert_int_equal(sdm_exact_shape_jacobian(s, &at, NULL, &g, values, j, NULL, &err),
                     SDM_E_PLUGIN);
    assert_non_null(strstr(err.text, "the number must not depend on the parameters"));
    assert_int_equal(sdm_exact_shape_jacobian(s, &outside, NULL, &g, values, j, NULL, &err),
                     SDM_E_RANGE);
    assert_int_equal(sdm_exact_shape_jacobian(NULL, &fine, NULL, &g, values, j, NULL, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_exact_shape_jacobian(s, NULL, NULL, &g, values, j, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_shape_jacobian(s, &fine, NULL, NULL, values, j, NULL, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_exact_shape_jacobian(s, &fine, NULL, &g, values, NULL, NULL, &err),
                     SDM_E_ARG);
    for (unsigned long n = 1;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status status = sdm_exact_shape_jacobian(s, &fine, NULL, &g, NULL, j, NULL, &err);
        sdm_alloc_fail_after(0);
        assert_true(n < 500);
        if (!status) break;
        assert_int_equal(status, SDM_E_NOMEM);
    }

    sdm_exact *e = engine_at(s, &fine, NULL);
    const double velocity[12] = {0};
    assert_int_equal(sdm_exact_map_derivative(e, &g, velocity, 1, NULL, j, &err), SDM_OK);
    assert_int_equal(sdm_exact_map_derivative(NULL, &g, velocity, 1, NULL, j, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_derivative(e, NULL, velocity, 1, NULL, j, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_derivative(e, &g, NULL, 1, NULL, j, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_derivative(e, &g, velocity, 0, NULL, j, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_derivative(e, &g, velocity, 1, NULL, NULL, &err), SDM_E_ARG);
    g.n[0] = 0;
    assert_int_equal(sdm_exact_map_derivative(e, &g, velocity, 1, NULL, j, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_shape_jacobian(s, &fine, NULL, &g, values, j, NULL, &err),
                     SDM_E_ARG);
    sdm_exact_free(e);
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_derivatives_of_cochlea),
        cmocka_unit_test(test_derivatives_of_superquadric),
        cmocka_unit_test(test_derivatives_in_closed_form),
        cmocka_unit_test(test_derivatives_without_velocity),
        cmocka_unit_test(test_same_bits_for_threads),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
