/* Fields outside of the box of the model: refused, a bound of the distance, exact distances.
 * Tests: field.c field_band.c field_grid.c field_points.c generate_field.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/field_scene.h"

/* A point at index[3] of the model's grid, and by how much (mm) it lies beyond the box. */
static double outer_point(const sdm_grid *g, const double index[3], double x[3], double nearest[3])
{
    double in[3], square = 0;
    for (int a = 0; a < 3; a++) {
        in[a] = fmin(fmax(index[a], 0), (double)(g->n[a] - 1));
        square += (index[a] - in[a]) * (index[a] - in[a]) * g->spacing[a] * g->spacing[a];
    }
    sdm_grid_world(g, index, x);
    sdm_grid_world(g, in, nearest);
    return sqrt(square);
}

static const double outer[][3] = {{-3, 5.2, 7.1}, {19.7, 5.2, 7.1}, {4.4, -2, 15},
                                  {-1, -2, -3},   {20, 15, 17},     {8, 6, 13.001}};
enum { N_OUTER = sizeof outer / sizeof *outer };

static void test_bound_outside(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_BOUND};
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        sdm_field *f = open_field(s->model[t], &o, true);
        for (int i = 0; i < N_OUTER; i++) {
            double x[3], nearest[3];
            float value, gradient[3], slopes[2];
            const double r = outer_point(&g, outer[i], x, nearest),
                         d = oracle_at(&s->value[t], nearest, NULL), bound = sqrt(r * r + d * d);
            assert_true(d > 0); // the ball lies in the box
            assert_false(sdm_field_point(f, x, &value, gradient, slopes, NULL));
            assert_true(fabs((double)value - bound) < 2e-6);
            for (int p = 0; p < 2; p++)
                assert_true(fabs((double)slopes[p] -
                                 d / bound * oracle_at(&s->slope[t][p], nearest, NULL)) < 2e-6);
            // the gradient agrees with central differences of the bound
            for (int a = 0; a < 3; a++) {
                const double h = 1e-3;
                float ends[2];
                for (int e = 0; e < 2; e++) {
                    double y[3] = {x[0], x[1], x[2]};
                    y[a] += e ? h : -h;
                    assert_false(sdm_field_point(f, y, &ends[e], NULL, NULL, NULL));
                }
                if (i != N_OUTER - 1) // that point lies too near to the box
                    assert_true(fabs(((double)ends[1] - (double)ends[0]) / (2 * h) -
                                     (double)gradient[a]) < 2e-3);
            }
        }
        sdm_field_free(f);
    }
}

/* The distance to a ball in the box is never below the bound, and the bound is no trivial one. */
static void test_bound_is_below_the_distance(void **state)
{
    (void)state;
    const sdm_grid g = model_grid(false);
    sdm_model *m = ball_model("bulge", &g, NULL);
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_BOUND};
    sdm_field *f = open_field(m, &o, false);
    double worst = 0;
    for (uint64_t i = 0; i < 2000; i++) {
        double index[3], x[3], nearest[3];
        for (int a = 0; a < 3; a++)
            index[a] = (3 * uniform(3 * i + (uint64_t)a) - 1) * (double)g.n[a];
        if (outer_point(&g, index, x, nearest) == 0) continue;
        const double exact = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - ball_radius(params);
        float value;
        assert_false(sdm_field_point(f, x, &value, NULL, NULL, NULL));
        assert_true((double)value < exact + 2e-3); // the spline's error
        worst = fmax(worst, exact - (double)value);
    }
    assert_true(worst < 1.7); // distances go up to 9 mm
    sdm_field_free(f);
    sdm_model_free(m);
}

static void test_refused_outside(void **state)
{
    const scene *s = *state;
    const sdm_grid m = model_grid(false);
    sdm_grid g = m;
    static float values[BALL_VOXELS];
    sdm_blocks band;
    sdm_error err;
    g.origin[0] -= 0.01;
    assert_int_equal(sdm_generate_grid(s->model[0], params, NULL, &g, values, NULL, NULL, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "the grid leaves the box"));
    assert_non_null(strstr(err.text, "sdm_generate_opts.outside bound or exact"));
    double x[6] = {0, 0, 0, 9, 1, 1};
    assert_int_equal(
        sdm_generate_points(s->model[0], params, NULL, x, 2, values, NULL, NULL, NULL, &err),
        SDM_E_RANGE);
    assert_non_null(strstr(err.text, "point 2 of 2 (9, 1, 1) mm lies outside of the box"));
    // roundings of a position on the face of the box are no reason
    x[3] = m.origin[0] - 1e-12;
    assert_false(
        sdm_generate_points(s->model[0], params, NULL, x, 2, values, NULL, NULL, NULL, &err));
    // a band that stays in the box may be asked for on a grid that leaves it
    assert_false(sdm_generate_band(s->model[0], params, NULL, &g, 0.4, &band, NULL, &err));
    assert_true(band.n_block > 0);
    sdm_blocks_dispose(&band);
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, &g, 3, &band, NULL, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "the band leaves the box"));
    assert_true(!band.values && !band.tile);
}

static void test_band_with_bound(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_BOUND};
    for (int t = 0; t < 2; t++) {
        sdm_grid g = model_grid(t);
        sdm_field *f = open_field(s->model[t], &o, false);
        for (int a = 0; a < 3; a++) g.origin[a] -= 0.7, g.n[a] = 50, g.spacing[a] /= 2;
        check_band(f, &g, 1.2);
        sdm_field_free(f);
    }
}

static void test_exact_outside(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_EXACT, .exact_shape = s->shape};
    sdm_grid g = model_grid(false);
    for (int a = 0; a < 3; a++) g.origin[a] -= 0.7;
    const size_t n = sdm_grid_count(&g);
    static float values[BALL_VOXELS], exact[BALL_VOXELS], bound[BALL_VOXELS], slopes[2];
    assert_false(sdm_exact_shape_map(s->shape, params, NULL, &g, exact, NULL, NULL));
    assert_false(sdm_generate_grid(s->model[0], params, &o, &g, values, NULL, NULL, NULL));
    sdm_field *f = open_field(s->model[0], &(sdm_generate_opts){.outside = SDM_OUTSIDE_BOUND},
                              false),
              *e = open_field(s->model[0], &o, true);
    assert_false(sdm_field_grid(f, &g, bound, NULL, NULL));
    size_t n_exact = 0;
    for (size_t v = 0; v < n; v++) {
        const double index[3] = {(double)(v % (size_t)g.n[0]),
                                 (double)(v / (size_t)g.n[0] % (size_t)g.n[1]),
                                 (double)(v / (size_t)(g.n[0] * g.n[1]))};
        const bool out = index[0] * 0.25 < 0.7 || index[1] * 0.31 < 0.7 || index[2] * 0.28 < 0.7;
        n_exact += out;
        assert_true(values[v] == (out ? exact[v] : bound[v]));
    }
    assert_true(n_exact > n / 4 && n_exact < n);
    // a point, its derivatives, and a band that leaves the box
    const double x[3] = {3, 1, -2};
    float value, gradient[3];
    sdm_error err;
    assert_false(sdm_field_point(e, x, &value, gradient, NULL, &err));
    const double r = sqrt(14);
    assert_true(fabs((double)value - (r - ball_radius(params))) < 5e-3);
    for (int a = 0; a < 3; a++) assert_true(fabs((double)gradient[a] - x[a] / r) < 0.05);
    assert_false(sdm_field_point(e, x, &value, NULL, slopes, &err));
    assert_true(fabs((double)slopes[0] + 1) < 5e-3 && fabs((double)slopes[1] + 0.1) < 5e-4);
    assert_int_equal(sdm_field_grid(e, &g, values, exact, &err), SDM_E_UNSUPPORTED);
    check_band(e, &g, 1.5);
    sdm_field_free(e);
    sdm_field_free(f);
}

/* A ball with one more vertex, which no triangle uses, above the radius of the test. */
static int mesh_growing(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    const size_t n_vert = 2 + (RINGS - 1) * SECTORS;
    if (mesh_ball(self, host, options, p, out)) return 1;
    if (!(p[0] > params[0])) return 0;
    static double vert[3 * (3 + (RINGS - 1) * SECTORS)];
    static uint32_t tri[6 * (RINGS - 1) * SECTORS];
    memcpy(vert, out->vert, 3 * n_vert * sizeof *vert);
    memcpy(tri, out->tri, sizeof tri);
    if (host->reserve(host, out, n_vert + 1, 2 * (RINGS - 1) * SECTORS)) return 1;
    memcpy(out->vert, vert, sizeof vert);
    memcpy(out->tri, tri, sizeof tri);
    return 0;
}

/* Vertices whose number depends on a parameter have no velocities: slopes are known in the box
   alone, and distances everywhere. */
static void test_exact_outside_without_velocities(void **state)
{
    const scene *s = *state;
    sdm_shape growing = ball_shape;
    growing.mesh = mesh_growing;
    sdm_error err;
    sdm_instance *shape;
    assert_false(sdm_instance_create(&growing, NULL, 0, NULL, &shape, &err));
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_EXACT, .exact_shape = shape};
    sdm_field *f = open_field(s->model[0], &o, true);
    const double in[3] = {1, 0.5, 0.2}, out[3] = {3, 1, -2};
    float value, slopes[2];
    assert_false(sdm_field_point(f, in, &value, NULL, slopes, &err));
    assert_true((double)slopes[0] < -0.3);
    assert_false(sdm_field_point(f, out, &value, NULL, NULL, &err));
    assert_true(fabs((double)value - (sqrt(14) - ball_radius(params))) < 5e-3);
    assert_int_equal(sdm_field_point(f, out, &value, NULL, slopes, &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, "the vertices of the exact shape have no derivatives"));
    sdm_field_free(f);
    sdm_instance_free(shape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bound_outside),
        cmocka_unit_test(test_bound_is_below_the_distance),
        cmocka_unit_test(test_refused_outside),
        cmocka_unit_test(test_band_with_bound),
        cmocka_unit_test(test_exact_outside),
        cmocka_unit_test(test_exact_outside_without_velocities),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
