/* Distances of points from the surface of a shape, without voxels: their derivatives and those of
 * the area against differences, on the surface and on a map; and fits to points of a hollow shape,
 * whose walls hold its ends at wrong places.
 * Tests: shape_surface.c map_area.c even_points.c map_bias.c influence.c network_bias.c
 * averaged_gradient.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "ball_model.h"
#include "fit/data/map_area.h"
#include "oracle/fit_tools.h"
#include "oracle/revolved.h"

#define PI 3.14159265358979324

// ---- a cup: a tube with a bottom, and walls as thin as `wall`

enum { HEIGHT, RADIUS, WALL, CUP_PARAMS };
enum { AROUND = 32, ALONG = 20, CUP_RINGS = 2 * ALONG };

static const sdm_param cup_params[CUP_PARAMS] = {{"height", "mm", 12, 30, 20, ""},
                                                 {"radius", "mm", 3, 5, 4, ""},
                                                 {"wall", "mm", 0.4, 1.2, 0.8, ""}};

// radius and height of a ring: along the outside from the bottom up, then down the inside
static void cup_ring(const double *p, int i, double *r, double *z)
{
    const double along = (double)(i % ALONG) / (ALONG - 1);
    *r = i < ALONG ? p[RADIUS] : p[RADIUS] - p[WALL];
    *z = i < ALONG ? p[HEIGHT] * along : p[HEIGHT] - (p[HEIGHT] - p[WALL]) * along;
}

static int cup_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return revolved_mesh(host, out, CUP_RINGS, AROUND, cup_ring, p, 0, p[WALL]);
}

static const sdm_shape cup = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "cup",
                              .summary = "a cup",
                              .params = cup_params,
                              .n_params = CUP_PARAMS,
                              .mesh = cup_mesh};

static sdm_instance *instance_of(const sdm_shape *shape)
{
    sdm_instance *out = NULL;
    assert_int_equal(sdm_instance_create(shape, NULL, 0, NULL, &out, NULL), SDM_OK);
    return out;
}

// ---- derivatives

static shape_surface surface_at(const sdm_instance *shape, const double *p)
{
    shape_surface s = {0};
    assert_int_equal(sdm_shape_surface_make(shape, p, true, NULL, &s, NULL), SDM_OK);
    return s;
}

static void test_derivatives_of_distances(void **state)
{
    (void)state;
    const double p[CUP_PARAMS] = {18, 4.2, 0.7}, e = 1e-5;
    sdm_instance *shape = instance_of(&cup);
    shape_surface s = surface_at(shape, p);
    for (uint64_t i = 0; i < 60; i++) {
        double x[3], closest[3], gradient[3], by[CUP_PARAMS];
        uint32_t triangle;
        for (size_t a = 0; a < 3; a++)
            x[a] = (a < 2 ? 12 : 24) * sdm_rng_uniform(11, a, i) - (a < 2 ? 6 : 3);
        (void)sdm_exact_point(s.engine, x, closest, gradient, &triangle);
        sdm_shape_surface_derivatives(&s, triangle, closest, gradient, by);
        for (size_t k = 0; k < CUP_PARAMS; k++) {
            double change = 0;
            for (int side = -1; side <= 1; side += 2) {
                double q[CUP_PARAMS];
                memcpy(q, p, sizeof q);
                q[k] += side * e;
                shape_surface other = surface_at(shape, q);
                change += side * sdm_exact_point(other.engine, x, NULL, NULL, NULL) / (2 * e);
                sdm_shape_surface_dispose(&other);
            }
            // a nearest point at an edge between triangles of one sheet changes sides: no kink
            if (!(fabs(by[k] - change) < 1e-4))
                fail_msg("point %d, parameter %zu: %g, by differences %g", (int)i, k, by[k],
                         change);
        }
    }
    sdm_shape_surface_dispose(&s);
    sdm_instance_free(shape);
}

static void test_area_of_the_surface(void **state)
{
    (void)state;
    const double p[CUP_PARAMS] = {18, 4.2, 0.7}, e = 1e-5, n = AROUND, around = 2 * n * sin(PI / n),
                 disc = 0.5 * n * sin(2 * PI / n), r = p[RADIUS], q = r - p[WALL];
    const double expected = around * (r * p[HEIGHT] + q * (p[HEIGHT] - p[WALL])) +
                            disc * (r * r + (r * r - q * q) + q * q);
    sdm_instance *shape = instance_of(&cup);
    shape_surface s = surface_at(shape, p);
    double area, gradient[CUP_PARAMS];
    sdm_shape_surface_area(&s, &area, gradient);
    assert_true(fabs(area / expected - 1) < 1e-12);
    for (size_t k = 0; k < CUP_PARAMS; k++) {
        double change = 0;
        for (int side = -1; side <= 1; side += 2) {
            double at[CUP_PARAMS], other, ignored[CUP_PARAMS];
            memcpy(at, p, sizeof at);
            at[k] += side * e;
            shape_surface moved = surface_at(shape, at);
            sdm_shape_surface_area(&moved, &other, ignored);
            sdm_shape_surface_dispose(&moved);
            change += side * other / (2 * e);
        }
        assert_true(fabs(gradient[k] - change) < 1e-4 * fabs(change));
    }
    sdm_shape_surface_dispose(&s);
    sdm_instance_free(shape);
}

static void test_area_on_a_map(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((int64_t[3]){36, 36, 36}, 0.12, (double[3]){0, 0, 0});
    const double p[2] = {1.4, 0.3}, r = ball_radius(p), area = 4 * PI * r * r;
    sdm_instance *ball = instance_of(&ball_shape);
    const sdm_fit_source source = {.shape = ball, .grid = grid};
    const sdm_fit_opts o = sdm_fit_defaults();
    fit_maps maps;
    double found, gradient[2];
    assert_int_equal(sdm_fit_maps_create(&source, false, &o, &maps, NULL), SDM_OK);
    assert_int_equal(sdm_fit_maps_make(&maps, p, true, NULL), SDM_OK);
    sdm_fit_maps_area(&maps, &found, gradient);
    assert_true(fabs(found / area - 1) < 0.01);
    // d area / d r = 8 pi r; the second parameter is a tenth of a mm
    assert_true(fabs(gradient[0] / (8 * PI * r) - 1) < 0.03);
    assert_true(fabs(gradient[1] / (0.8 * PI * r) - 1) < 0.03);
    sdm_fit_maps_dispose(&maps);
    sdm_instance_free(ball);
}

// ---- fits

enum { POINTS = 1500, MANY = 6000 };

static const double ERROR = 0.03; // mm

// n points on the surface of a shape at p with errors from random numbers of `seed`; every stray-th
// lies anywhere near
static double *points_on(const sdm_instance *shape, const double *p, size_t n, double error_sd,
                         uint64_t seed, size_t stray)
{
    sdm_mesh m = {0};
    double *x = calloc(3 * n, sizeof *x);
    if (!x) abort();
    assert_int_equal(sdm_instance_mesh(shape, p, &m, NULL), SDM_OK);
    assert_int_equal(sdm_fit_surface_points(&m, n, 5, x, NULL), SDM_OK);
    sdm_mesh_dispose(&m);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < 3; k++) {
            x[3 * i + k] += error_sd * sdm_rng_normal(seed, k, i);
            if (stray && i % stray == 0)
                x[3 * i + k] = (k < 2 ? 12 : 24) * sdm_rng_uniform(22, k, i) - (k < 2 ? 6 : 3);
        }
    return x;
}

/* From one start of another height. The points of the rim, one in a hundred, lie beside the walls
 * of a cup that is too high, and nothing else tells that it is. */
static void test_ends_of_a_hollow_shape_are_found(void **state)
{
    (void)state;
    const double truths[2][CUP_PARAMS] = {{17, 4.2, 0.7}, {24, 3.6, 0.9}};
    sdm_instance *shape = instance_of(&cup);
    for (size_t c = 0; c < 4; c++) {
        const double *truth = truths[c / 2];
        double *x = points_on(shape, truth, POINTS, ERROR, 23, c % 2 ? 5 : 0);
        const sdm_fit_source source = {
            .shape = shape,
            .grid = sdm_grid_centred((int64_t[3]){28, 28, 80}, 0.42, (double[3]){0, 0, 14})};
        const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = POINTS};
        sdm_fit_opts o = sdm_fit_defaults();
        sdm_fit_result r;
        sdm_error err = {0};
        o.n_threads = 2;
        if (sdm_fit(&source, &target, &o, &r, &err)) fail_msg("case %zu: %s", c, err.text);
        for (size_t k = 0; k < CUP_PARAMS; k++) {
            const double error = fabs(r.params[k] - truth[k]);
            if (!(error < 4 * r.sd[k] && r.sd[k] < 0.04))
                fail_msg("case %zu, %s: %g for %g, sd %g", c, cup_params[k].name, r.params[k],
                         truth[k], r.sd[k]);
        }
        sdm_fit_dispose(&r);
        free(x);
    }
    sdm_instance_free(shape);
}

/* The height moves the rim alone, one point in a hundred: the estimate goes by differences over a
 * motion of these points that is small against their errors, also where voxels are large. */
static void test_ends_have_the_stated_deviations(void **state)
{
    (void)state;
    enum { CASES = 8 };
    sdm_instance *shape = instance_of(&cup);
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){18, 18, 40}, 0.9, (double[3]){0, 0, 14})};
    double squares[CUP_PARAMS] = {0};
    for (uint64_t c = 0; c < CASES; c++) {
        double truth[CUP_PARAMS];
        for (size_t k = 0; k < CUP_PARAMS; k++)
            truth[k] = cup_params[k].min + (cup_params[k].max - cup_params[k].min) *
                                               (0.2 + 0.6 * sdm_rng_uniform(31, k, c));
        double *x = points_on(shape, truth, POINTS, ERROR, 40 + c, 0);
        const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = POINTS};
        sdm_fit_opts o = sdm_fit_defaults();
        sdm_fit_result r;
        sdm_error err = {0};
        o.n_threads = 2;
        if (sdm_fit(&source, &target, &o, &r, &err)) fail_msg("case %d: %s", (int)c, err.text);
        for (size_t k = 0; k < CUP_PARAMS; k++) {
            const double error = (r.params[k] - truth[k]) / r.sd[k];
            squares[k] += error * error / CASES;
            if (!(fabs(error) < 4))
                fail_msg("case %d, %s: %g deviations off", (int)c, cup_params[k].name, error);
        }
        sdm_fit_dispose(&r);
        free(x);
    }
    // the mean of eight squares of standard normal numbers exceeds 3.3 once in a thousand cases
    for (size_t k = 0; k < CUP_PARAMS; k++) assert_true(squares[k] < 3.3);
    sdm_instance_free(shape);
}

/* Points without errors: a cup of another height has the same walls and takes the points of the rim
 * for strays, which is no better explanation. */
static void test_points_without_errors_pass(void **state)
{
    (void)state;
    const double truth[CUP_PARAMS] = {17, 4.2, 0.7};
    sdm_instance *shape = instance_of(&cup);
    double *x = points_on(shape, truth, MANY, 0, 23, 0);
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){28, 28, 80}, 0.42, (double[3]){0, 0, 14})};
    const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = MANY};
    const sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err = {0};
    bool tried = false;
    if (sdm_fit(&source, &target, &o, &r, &err)) fail_msg("%s", err.text);
    for (size_t i = 0; i < r.verdict.n_findings; i++) {
        const sdm_fit_finding *f = &r.verdict.findings[i];
        tried = tried || f->kind == SDM_FIT_CHECK_NEXT_POSE;
        if (f->grade != SDM_FIT_PASSED) fail_msg("%s: %s", sdm_fit_check_name(f->kind), f->text);
    }
    assert_true(tried);
    sdm_fit_dispose(&r);
    free(x);
    sdm_instance_free(shape);
}

/* A network has voxels: its deviations hold what they do to the estimate, and the search for the
 * shape on whose surface points lie evenly takes the area from its map. */
static void test_points_and_a_network(void **state)
{
    (void)state;
    const sdm_grid grid = sdm_grid_centred((int64_t[3]){17, 17, 17}, 0.25, (double[3]){0, 0, 0});
    const double p[2] = {1.3, 0};
    sdm_instance *ball = instance_of(&ball_shape);
    sdm_model *model = ball_model("bulge", &grid, NULL);
    double *x = points_on(ball, p, POINTS, ERROR, 23, 0);
    const sdm_fit_source source = {.model = model};
    const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = POINTS};
    sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, &target, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    // radius and bulge are one unknown: only their sum is determined
    assert_true(fabs(ball_radius(r.params) - 1.3) < 0.01);
    sdm_fit_dispose(&r);
    free(x);
    sdm_model_free(model);
    sdm_instance_free(ball);
}

// The derivatives by the radius of networks that err by a tenth, and by a half.
static double nine_tenths(const double x[3])
{
    (void)x;
    return 0.9;
}
static double a_half(const double x[3])
{
    (void)x;
    return 0.5;
}

static double radius_variance(const sdm_fit_result *r)
{
    const double *c = r->covariance;
    const size_t size = r->n_params + 6;
    return c[0] + 0.2 * c[1] + 0.01 * c[size + 1];
}

/* The check tells the change in the unit of its parameter, over the deviation without it, which is
 * that of a parameter that the data determine; no figure at the end of its range. */
static void network_error_text(const sdm_fit_result *r)
{
    const size_t k = r->network_error_param;
    const double alone = sqrt(r->sd[k] * r->sd[k] - r->network_error * r->network_error);
    size_t i = 0;
    char by[80];
    assert_true(alone < r->prior_sd[k]);
    while (r->verdict.findings[i].kind != SDM_FIT_CHECK_NETWORK_ERROR) i++;
    const sdm_fit_finding *x = &r->verdict.findings[i];
    if (x->grade == SDM_FIT_PASSED) return;
    if (isnan(x->figure)) {
        assert_true(r->at_bound[k]);
        assert_non_null(strstr(x->text, ", which "));
        return;
    }
    assert_true(fabs(r->network_error / alone / r->network_error_sd - 1) < 1e-6);
    snprintf(by, sizeof by, "by about %.2g mm, %.2g times the standard deviation by the data alone",
             r->network_error, r->network_error_sd);
    if (!strstr(x->text, by)) fail_msg("not '%s': %s", by, x->text);
}

/* A network whose map is that of a ball of 1.25 + slope (radius - 1.25) mm takes points of one of
 * 1.26 mm for one of about 1.25 + 0.01 / slope mm. Where the shape is known, the covariance holds
 * the square of the difference to the fit with exact distances, however wrong the derivative of the
 * network is. */
static void network_error(double slope, double (*derivative)(const double[3]))
{
    const sdm_grid grid = sdm_grid_centred((int64_t[3]){17, 17, 17}, 0.25, (double[3]){0, 0, 0});
    const double p[2] = {1.26, 0};
    sdm_instance *ball = instance_of(&ball_shape);
    sdm_model *model = ball_model("bulge", &grid, derivative);
    double *x = points_on(ball, p, POINTS, ERROR, 23, 0), variance[3], radius[3];
    const sdm_fit_source source[3] = {
        {.model = model}, {.model = model, .shape = ball}, {.shape = ball, .grid = grid}};
    const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = POINTS};
    for (int i = 0; i < 3; i++) {
        const sdm_fit_opts o = sdm_fit_defaults();
        sdm_fit_result r;
        sdm_error err = {0};
        const sdm_status s = sdm_fit(&source[i], &target, &o, &r, &err);
        if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
        assert_true((i == 1) == !isnan(r.network_error_sd));
        if (i == 1) network_error_text(&r);
        radius[i] = ball_radius(r.params);
        variance[i] = radius_variance(&r);
        sdm_fit_dispose(&r);
    }
    assert_true(fabs(radius[1] - 1.25 - 0.01 / slope) < 0.001 / slope);
    const double found = sqrt(variance[1] - variance[0]), error = radius[1] - radius[2];
    if (!(fabs(found - error) < 0.05 * error)) fail_msg("%g mm, not %g mm", found, error);
    free(x);
    sdm_model_free(model);
    sdm_instance_free(ball);
}

static void test_the_error_of_a_network_is_measured(void **state)
{
    (void)state;
    network_error(0.9, nine_tenths);
    network_error(0.5, a_half);
}

/* The remedy for a biased network, and whether r->advised_voxel_mm is set: of labels with voxels of
 * `edge` mm. */
static bool finer_maps_are_the_remedy(double edge)
{
    const sdm_grid grid = sdm_grid_centred((int64_t[3]){17, 17, 17}, 0.25, (double[3]){0, 0, 0});
    const int64_t n = (int64_t)ceil(4 / edge) | 1;
    const sdm_grid g = sdm_grid_centred((int64_t[3]){n, n, n}, edge, (double[3]){0, 0, 0});
    sdm_instance *ball = instance_of(&ball_shape);
    sdm_model *model = ball_model("bulge", &grid, a_half);
    float *v = malloc(sdm_grid_count(&g) * sizeof *v);
    assert_non_null(v);
    for (int64_t i = 0; i < n * n * n; i++) {
        double x[3];
        sdm_grid_world(&g, (double[3]){(double)(i % n), (double)(i / n % n), (double)(i / n / n)},
                       x);
        v[i] = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] < 1.35 * 1.35;
    }
    const sdm_fit_source source = {.model = model, .shape = ball};
    const sdm_fit_target target = {.kind = SDM_FIT_LABEL, .grid = g, .values = v};
    const bool keep[2] = {false, true};
    sdm_fit_opts o = sdm_fit_defaults_for(1);
    o.kept = keep, o.keep_pose = true;
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, &target, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    size_t i = 0, voxels = 0;
    while (r.verdict.findings[i].kind != SDM_FIT_CHECK_NETWORK_ERROR) i++;
    while (r.verdict.findings[voxels].kind != SDM_FIT_CHECK_VOXELS) voxels++;
    assert_int_equal(r.verdict.findings[i].grade, SDM_FIT_DOUBTFUL);
    assert_int_equal(r.verdict.findings[voxels].grade, SDM_FIT_PASSED);
    const bool finer = strstr(r.verdict.findings[i].text, "(sdm_fit_source.grid) end it");
    assert_true(finer == !strstr(r.verdict.findings[i].text, "a polish"));
    assert_true(finer == isfinite(r.advised_voxel_mm));
    if (finer) assert_true(fabs(r.advised_voxel_mm - 1.2 * edge) < 1e-9);
    sdm_fit_dispose(&r);
    free(v);
    sdm_model_free(model);
    sdm_instance_free(ball);
    return finer;
}

// A polish stays on the grid of the network, 0.25 mm: it is no remedy where these voxels are within
// a fifth of the limit, 1.5 voxels of the labels, which the polish may move.
static void test_remedy_of_a_biased_network(void **state)
{
    (void)state;
    assert_true(finer_maps_are_the_remedy(0.2));
    assert_false(finer_maps_are_the_remedy(0.3));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_derivatives_of_distances),
        cmocka_unit_test(test_area_of_the_surface),
        cmocka_unit_test(test_area_on_a_map),
        cmocka_unit_test(test_ends_of_a_hollow_shape_are_found),
        cmocka_unit_test(test_ends_have_the_stated_deviations),
        cmocka_unit_test(test_points_without_errors_pass),
        cmocka_unit_test(test_points_and_a_network),
        cmocka_unit_test(test_the_error_of_a_network_is_measured),
        cmocka_unit_test(test_remedy_of_a_biased_network),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
