/* A pin, a shaft with a ball on either end, one a little larger than the other: upside down it has
 * almost the same surface. A fit to labels that starts upside down is refused, because the right
 * pose explains them better; a pin with equal balls has two right poses. A knob with three lobes
 * has three, and the turn between them is named. A block whose front differs from its back by a
 * small collar alone has one. Tests: next_pose.c rival.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/fit_tools.h"
#include "oracle/give_mesh.h"
#include "oracle/revolved.h"

enum { LENGTH, LOWER, PIN_PARAMS };
static const sdm_param pin_params[PIN_PARAMS] = {
    {"length", "mm", 14, 22, 18, "between the middles of the balls"},
    {"lower", "mm", 3, 5, 4, "radius of the lower ball"}};

enum { RINGS = 48, AROUND = 24 };
static const double UPPER = 4, SHAFT = 2.2;

static double ball_at(double z, double radius)
{
    return fabs(z) < radius ? sqrt(radius * radius - z * z) : 0;
}

static void pin_ring(const double *p, int i, double *r, double *z)
{
    const double half = 0.5 * p[LENGTH], low = -half - p[LOWER], high = half + UPPER;
    *z = low + (high - low) * (i + 1) / (RINGS + 1);
    *r = fmax(ball_at(*z + half, p[LOWER]), ball_at(*z - half, UPPER));
    if (fabs(*z) < half) *r = fmax(*r, SHAFT);
}

static int pin_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return revolved_mesh(host, out, RINGS, AROUND, pin_ring, p, -0.5 * p[LENGTH] - p[LOWER],
                         0.5 * p[LENGTH] + UPPER);
}

static const sdm_shape pin = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "pin",
                              .summary = "a shaft with two balls",
                              .params = pin_params,
                              .n_params = PIN_PARAMS,
                              .mesh = pin_mesh};

/* Fits the labels of a pin with this lower ball from its own pose or, turned, upside down. */
static sdm_status fit_pin(double lower, bool turned, sdm_fit_result *r, sdm_error *err)
{
    const double truth[PIN_PARAMS] = {18, lower};
    const sdm_grid g = sdm_grid_centred((int64_t[3]){30, 30, 70}, 0.5, (double[3]){0, 0, 0});
    sdm_fit_opts o = sdm_fit_defaults();
    if (turned) o.start_pose.rotation[0] = 3.141592653589793;
    o.polish_eps = 1e-3;
    o.max_restarts = 0;
    return fit_labels_of(&pin, truth, &g, &o, r, err);
}

static const sdm_fit_finding *next_pose(const sdm_fit_result *r)
{
    for (size_t i = 0; i < r->verdict.n_findings; i++)
        if (r->verdict.findings[i].kind == SDM_FIT_CHECK_NEXT_POSE) return &r->verdict.findings[i];
    return NULL;
}

static void check(double lower, bool turned, bool accepted)
{
    sdm_fit_result r;
    sdm_error err;
    const sdm_status s = fit_pin(lower, turned, &r, &err);
    const sdm_fit_finding *f = next_pose(&r);
    if (accepted ? s != SDM_OK : s != SDM_E_QUALITY || !f || f->grade != SDM_FIT_FAILED)
        fail_msg("lower ball %g, turned %d: %s (%s); %s", lower, turned, sdm_status_name(s),
                 err.text, f ? f->text : "no next pose");
    sdm_fit_dispose(&r);
}

static void test_upside_down_is_refused(void **state)
{
    (void)state;
    check(4.2, true, false);
    check(4.2, false, true);
}

static void test_both_ways_of_a_symmetric_pin_pass(void **state)
{
    (void)state;
    check(UPPER, true, true);
    check(UPPER, false, true);
}

static const sdm_param knob_params[1] = {{"radius", "mm", 4, 8, 6, "of the upper end"}};

static void knob_ring(const double *p, int i, double *r, double *z)
{
    const double t = (double)i / (RINGS - 1);
    *z = 10 * t;
    *r = p[0] * (0.6 + 0.4 * t);
}

static int knob_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int s = revolved_mesh(host, out, RINGS, 48, knob_ring, p, -0.5, 10.5);
    for (size_t v = 0; v < out->n_vert && !s; v++) {
        double *x = out->vert + 3 * v;
        const double lobe = 1 + 0.3 * cos(3 * atan2(x[1], x[0]));
        x[0] *= lobe, x[1] *= lobe;
    }
    return s;
}

static const sdm_shape knob = {.abi = SDM_SHAPE_ABI,
                               .size = sizeof(sdm_shape),
                               .name = "knob",
                               .summary = "a knob with three lobes",
                               .params = knob_params,
                               .n_params = 1,
                               .mesh = knob_mesh};

static void test_third_of_a_turn_is_named(void **state)
{
    (void)state;
    const double truth[1] = {6};
    const sdm_grid g = sdm_grid_centred((int64_t[3]){45, 45, 32}, 0.5, (double[3]){0, 0, 5});
    sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err;
    o.polish_eps = 1e-3;
    const sdm_status s = fit_labels_of(&knob, truth, &g, &o, &r, &err);
    const sdm_fit_finding *f = next_pose(&r);
    if (s || !f || !strstr(f->text, "turned by 120 degrees about"))
        fail_msg("%s (%s); %s", sdm_status_name(s), err.text, f ? f->text : "no next pose");
    sdm_fit_dispose(&r);
}

/* A block whose front, the side of negative y, has a collar of 0.9 % of its volume. */
static const double BLOCK[3] = {10, 5.5, 16}, COLLAR_LOW[3] = {-3, -7, -7},
                    COLLAR_HIGH[3] = {3, -4, -1};

static int block_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const double low[3] = {-p[0], -BLOCK[1], -BLOCK[2]}, high[3] = {p[0], BLOCK[1], BLOCK[2]};
    sdm_mesh m = {0}, collar = {0};
    mesh_box(&m, low, high);
    mesh_box(&collar, COLLAR_LOW, COLLAR_HIGH);
    mesh_append(&m, &collar);
    sdm_mesh_dispose(&collar);
    return give_mesh(host, out, &m);
}

static const sdm_param block_params[1] = {{"half_width", "mm", 8, 12, 10, ""}};
static const sdm_shape block = {.abi = SDM_SHAPE_ABI,
                                .size = sizeof(sdm_shape),
                                .name = "block",
                                .summary = "a block with a collar",
                                .params = block_params,
                                .n_params = 1,
                                .mesh = block_mesh};

/* Fits points of the block, 1.5 mm apart, half a turn about z from its pose or in it. A fit that is
 * refused goes on from the pose that explains the points better, if it may. */
static void check_block(bool turned, size_t restarts, sdm_status expected)
{
    enum { POINTS_MAX = 2000 };
    sdm_instance *shape = NULL;
    sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err = {0};
    double *points = calloc(3 * POINTS_MAX, sizeof *points);
    if (!points || sdm_instance_create(&block, NULL, 0, NULL, &shape, NULL)) abort();
    size_t n = 0;
    for (int side = 0; side < 6; side++)
        for (int i = 0; i < 22; i++)
            for (int j = 0; j < 22; j++) {
                const size_t a = (size_t)side / 2, b = (a + 1) % 3, c = (a + 2) % 3;
                double x[3];
                x[a] = side % 2 ? BLOCK[a] : -BLOCK[a];
                x[b] = 1.5 * i + 0.4 - BLOCK[b], x[c] = 1.5 * j + 0.7 - BLOCK[c];
                if (x[b] > BLOCK[b] || x[c] > BLOCK[c]) continue;
                if (side == 2 && fabs(x[0]) < COLLAR_HIGH[0] && fabs(x[2] + 4) < 3)
                    x[1] = COLLAR_LOW[1];
                for (int k = 0; k < 3; k++, n++)
                    points[n] = x[k] + 0.1 * sin(7.3 * (double)n + 0.9 * (double)(n * n % 97));
            }
    if (turned) o.start_pose.rotation[2] = 3.141592653589793;
    o.max_restarts = restarts;
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){48, 32, 64}, 0.6, (double[3]){0, 0, 0})};
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = points, .n_points = n / 3};
    const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
    const sdm_fit_finding *f = next_pose(&r);
    if (s != expected || !f || (f->grade == SDM_FIT_PASSED) != (expected == SDM_OK))
        fail_msg("turned %d: %s (%s); %s", turned, sdm_status_name(s), err.text,
                 f ? f->text : "no next pose");
    if (expected)
        assert_non_null(strstr(f->text, "in another pose, rotation ("));
    else if (!(fabs(r.pose.rotation[2]) < 0.02) || r.n_restarts != turned)
        fail_msg("rotation %g after %zu restarts", r.pose.rotation[2], r.n_restarts);
    sdm_fit_dispose(&r);
    sdm_instance_free(shape);
    free(points);
}

static void test_back_to_front_is_refused_or_turned(void **state)
{
    (void)state;
    check_block(false, 0, SDM_OK);
    check_block(true, 0, SDM_E_QUALITY);
    check_block(true, 1, SDM_OK);
}

/* 80 points of the surface of a pin: so few that they form hardly any neighbourhoods. Pins of
 * other lengths explain them worse all the same. */
static void test_few_points_tell_the_length(void **state)
{
    (void)state;
    enum { POINTS = 80 };
    const double truth[PIN_PARAMS] = {18, 4.5};
    sdm_instance *shape = NULL;
    sdm_mesh m = {0};
    sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err = {0};
    double *points = calloc(3 * POINTS, sizeof *points);
    if (!points || sdm_instance_create(&pin, NULL, 0, NULL, &shape, NULL) ||
        sdm_instance_mesh(shape, truth, &m, NULL) ||
        sdm_fit_surface_points(&m, POINTS, 1, points, NULL))
        abort();
    for (size_t i = 0; i < 3 * POINTS; i++)
        points[i] += 0.1 * sin(7.3 * (double)i + 0.9 * (double)(i * i % 97));
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){24, 24, 64}, 0.6, (double[3]){0, 0, 0})};
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = points, .n_points = POINTS};
    const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
    const sdm_fit_finding *f = next_pose(&r);
    if (s || !f || f->grade != SDM_FIT_PASSED || !(f->figure > 30))
        fail_msg("%s (%s); next pose %g %s", sdm_status_name(s), err.text, f ? f->figure : NAN,
                 f ? f->text : "not tested");
    sdm_fit_dispose(&r);
    sdm_mesh_dispose(&m);
    sdm_instance_free(shape);
    free(points);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_upside_down_is_refused),
        cmocka_unit_test(test_both_ways_of_a_symmetric_pin_pass),
        cmocka_unit_test(test_third_of_a_turn_is_named),
        cmocka_unit_test(test_back_to_front_is_refused_or_turned),
        cmocka_unit_test(test_few_points_tell_the_length),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
