/* A polish of a fit to points: the exact shape has a rod that the network does not show, so that
 * the network leaves it too long. Tests: fit.c fit_defaults.c even_points.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "ball_model.h"
#include "oracle/revolved.h"
#include "sdm/fit.h"
#include "sdm/internal/rng.h"

enum { RADIUS, LENGTH, KNOB_PARAMS, BALL_RINGS = 40, AROUND = 48, POINTS = 1999 };
static const double ROD_RADIUS = 0.15, TRUTH[KNOB_PARAMS] = {1.3, -0.6}, NOISE = 0.01;

// the ball from below to the rod, which is 1.5 mm + LENGTH long, then the end of the rod
static void knob_ring(const double *p, int i, double *r, double *z)
{
    const double first = asin(ROD_RADIUS / p[RADIUS]), pi = 3.14159265358979324,
                 turn = pi - (pi - first) * (i + 1) / BALL_RINGS;
    *r = i < BALL_RINGS ? p[RADIUS] * sin(turn) : ROD_RADIUS;
    *z = i < BALL_RINGS ? p[RADIUS] * cos(turn) : p[RADIUS] + 1.5 + p[LENGTH];
}

static int knob_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return revolved_mesh(host, out, BALL_RINGS + 1, AROUND, knob_ring, p, -p[RADIUS],
                         p[RADIUS] + 1.5 + p[LENGTH]);
}

static const sdm_param knob_params[] = {{"radius", "mm", 1, 1.5, 1.2, "of the ball"},
                                        {"length", "mm", -1, 1, 0, "of the rod beyond 1.5 mm"}};
static const sdm_shape knob = {.abi = SDM_SHAPE_ABI,
                               .size = sizeof(sdm_shape),
                               .name = "knob",
                               .summary = "a ball with a rod",
                               .params = knob_params,
                               .n_params = KNOB_PARAMS,
                               .mesh = knob_mesh};

// Fits points of the knob with a network and then with exact distances, in at most so many
// iterations. The caller disposes of the result.
static sdm_fit_result fit_knob(size_t max_iterations, size_t max_polish_iterations)
{
    const sdm_grid grid = sdm_grid_centred((int64_t[3]){17, 17, 17}, 0.5, (double[3]){0, 0, 1});
    sdm_model *ball = ball_model("length", &grid, NULL);
    sdm_instance *shape = NULL;
    sdm_mesh m = {0};
    static double x[3 * POINTS];
    assert_int_equal(sdm_instance_create(&knob, NULL, 0, NULL, &shape, NULL), SDM_OK);
    assert_int_equal(sdm_instance_mesh(shape, TRUTH, &m, NULL), SDM_OK);
    assert_int_equal(sdm_fit_surface_points(&m, POINTS, 1, x, NULL), SDM_OK);
    for (size_t i = 0; i < 3 * POINTS; i++) x[i] += NOISE * sdm_rng_normal(1, 0, i);
    const sdm_fit_source source = {.model = ball, .shape = shape};
    const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = POINTS};
    sdm_fit_opts o = sdm_fit_defaults();
    o.max_iterations = max_iterations;
    o.max_polish_iterations = max_polish_iterations;
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, &target, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    sdm_mesh_dispose(&m);
    sdm_instance_free(shape);
    sdm_model_free(ball);
    return r;
}

// The points of the surface draw the end of the rod back, as in a fit without a network. The polish
// is made whether the network's fit converges or not, and then also if it was not asked for.
static void test_polish_draws_an_end_back(void **state)
{
    (void)state;
    static const struct {
        size_t iterations, polish;
    } cases[] = {{60, 120}, {1, 120}, {3, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_fit_result r = fit_knob(cases[i].iterations, cases[i].polish);
        if (!(r.polished && fabs(r.params[LENGTH] - TRUTH[LENGTH]) < 0.02))
            fail_msg("%zu: polished %d, length %g +- %g, %s", i, r.polished, r.params[LENGTH],
                     r.sd[LENGTH], r.reason);
        sdm_fit_dispose(&r);
    }
}

// A network's fit that converges has no polish, unless it was asked for.
static void test_no_polish(void **state)
{
    (void)state;
    sdm_fit_result r = fit_knob(60, 0);
    if (r.polished || !r.converged) fail_msg("polished %d: %s", r.polished, r.reason);
    sdm_fit_dispose(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_polish_draws_an_end_back),
                                       cmocka_unit_test(test_no_polish)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
