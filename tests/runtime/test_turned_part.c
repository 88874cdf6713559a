/* Points of the lower part of a pot, which is nearly round: a fit half a turn off stretches the
 * spout to the ends of its ranges and lies near the points. It leads to the right pose, or says
 * that this explains the points better. Points of the back alone, where no spout is, tell neither
 * pose. Points of a part of other shapes keep their pose.
 * Tests: shape_turns.c next_pose.c fit.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"
#include "oracle/pot.h"
#include "sdm/internal/vec3.h"

static const sdm_fit_finding *next_pose(const sdm_fit_result *r)
{
    for (size_t i = 0; i < r->verdict.n_findings; i++)
        if (r->verdict.findings[i].kind == SDM_FIT_CHECK_NEXT_POSE) return &r->verdict.findings[i];
    fail_msg("no next pose: %s", r->reason);
    return NULL;
}

static sdm_fit_result fit_pot(double top, bool back, bool turned, size_t restarts)
{
    sdm_instance *shape = NULL;
    sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err = {0};
    double points[3 * POT_POINTS];
    assert_int_equal(sdm_instance_create(&pot, NULL, 0, NULL, &shape, NULL), SDM_OK);
    const size_t n = pot_points(shape, top, back, points);
    const sdm_fit_source source = pot_source(shape);
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = points, .n_points = n};
    if (turned) o.start_pose.rotation[2] = 3.141592653589793;
    o.max_restarts = restarts;
    o.polish_eps = 1e-3;
    const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    sdm_instance_free(shape);
    return r;
}

static void assert_right(const sdm_fit_result *r)
{
    const double *turn = r->pose.rotation;
    if (r->verdict.grade == SDM_FIT_FAILED || !(v3_norm(turn) < 0.05) ||
        !(fabs(r->params[POT_TILT] - POT_TRUTH[POT_TILT]) < 3 * r->sd[POT_TILT]))
        fail_msg("rotation %.3g, %.3g, %.3g, tilt %.3g +- %.2g, grade %d (%s)", turn[0], turn[1],
                 turn[2], r->params[POT_TILT], r->sd[POT_TILT], (int)r->verdict.grade, r->reason);
    assert_int_equal(next_pose(r)->grade, SDM_FIT_PASSED);
}

static void test_half_a_turn_of_the_lower_part_is_undone(void **state)
{
    (void)state;
    sdm_fit_result r = fit_pot(1, false, true, 2);
    assert_right(&r);
    assert_int_equal(r.n_restarts, 1);
    sdm_fit_dispose(&r);
    r = fit_pot(1, false, false, 2);
    assert_right(&r);
    assert_int_equal(r.n_restarts, 0);
    sdm_fit_dispose(&r);
}

static void test_half_a_turn_of_the_lower_part_is_told(void **state)
{
    (void)state;
    sdm_fit_result r = fit_pot(1, false, true, 0);
    const sdm_fit_finding *f = next_pose(&r);
    if (f->grade == SDM_FIT_PASSED || !(f->figure < -SDM_FIT_PREFERRED) ||
        !strstr(f->text, "explains the data better"))
        fail_msg("next pose %g: %s", f->figure, f->text);
    sdm_fit_dispose(&r);
}

static void test_the_back_tells_no_side(void **state)
{
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        sdm_fit_result r = fit_pot(1, true, turned, 2);
        const sdm_fit_finding *f = next_pose(&r);
        if (f->grade != SDM_FIT_DOUBTFUL || !strstr(f->text, "do not tell the two apart"))
            fail_msg("turned %d: next pose %g: %s", turned, f->figure, f->text);
        sdm_fit_dispose(&r);
    }
}

/* Points of the round body, with an edge of the spout alone, leave the turn about its axis open, as
 * the fit says: the shape turned so is no rival. */
static void test_a_turn_about_an_open_axis_is_no_rival(void **state)
{
    (void)state;
    sdm_fit_result r = fit_pot(-0.5, false, false, 2);
    const sdm_fit_finding *f = next_pose(&r);
    assert_non_null(strstr(r.open_motions, "rotation about the axis"));
    if (f->grade != SDM_FIT_PASSED || !(f->figure > SDM_FIT_PREFERRED) ||
        !strstr(f->text, "differ only along"))
        fail_msg("next pose %g: %s", f->figure, f->text);
    sdm_fit_dispose(&r);
}

/* Points of the built-in shape with x below its median, errors of 0.02 mm. */
static void check_part(const char *name, const sdm_named_text *options, size_t n_options)
{
    enum { ALL = 800 };
    static double x[3 * ALL];
    sdm_instance *shape = NULL;
    sdm_mesh m = {0};
    sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_result r;
    sdm_error err = {0};
    size_t n_params, n = 0;
    assert_int_equal(sdm_instance_create(sdm_registry_find(registry, name, NULL), options,
                                         n_options, NULL, &shape, NULL),
                     SDM_OK);
    double truth[16];
    const sdm_param *params = sdm_instance_params(shape, &n_params);
    for (size_t k = 0; k < n_params; k++)
        truth[k] = params[k].def + 0.1 * (params[k].max - params[k].min);
    if (sdm_instance_mesh(shape, truth, &m, NULL) || sdm_fit_surface_points(&m, ALL, 2, x, NULL))
        abort();
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY},
           widest = 0;
    for (size_t i = 0; i < 3 * m.n_vert; i++) {
        low[i % 3] = fmin(low[i % 3], m.vert[i]);
        high[i % 3] = fmax(high[i % 3], m.vert[i]);
    }
    for (int k = 0; k < 3; k++) widest = fmax(widest, high[k] - low[k]);
    for (size_t i = 0; i < ALL; i++) {
        if (x[3 * i] > 0.6 * high[0] + 0.4 * low[0]) continue;
        for (size_t k = 0; k < 3; k++) x[3 * n + k] = x[3 * i + k] + 0.02 * sdm_rng_normal(1, k, i);
        n++;
    }
    const double middle[3] = {0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]),
                              0.5 * (low[2] + high[2])};
    const sdm_fit_source source = {
        .shape = shape, .grid = sdm_grid_centred((int64_t[3]){40, 40, 40}, widest / 26, middle)};
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = x, .n_points = n};
    o.polish_eps = 1e-3;
    const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
    const sdm_fit_finding *f = next_pose(&r);
    if (s || f->grade != SDM_FIT_PASSED || r.n_restarts)
        fail_msg("%s: %s, %zu restarts; next pose %g: %s", name, err.text, r.n_restarts, f->figure,
                 f->text);
    sdm_fit_dispose(&r);
    sdm_mesh_dispose(&m);
    sdm_instance_free(shape);
}

static void test_parts_of_other_shapes_keep_their_pose(void **state)
{
    (void)state;
    const sdm_named_text edge = {"edge", "0.5"}, links[] = {{"links", "2"}, {"edge", "0.5"}};
    check_part("torus", &edge, 1);
    check_part("capsule", &edge, 1);
    check_part("ellipsoid", &edge, 1);
    check_part("linkage", links, 2);
    check_part("cochlea", &(sdm_named_text){"edge", "0.6"}, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_half_a_turn_of_the_lower_part_is_undone),
        cmocka_unit_test(test_half_a_turn_of_the_lower_part_is_told),
        cmocka_unit_test(test_the_back_tells_no_side),
        cmocka_unit_test(test_a_turn_about_an_open_axis_is_no_rival),
        cmocka_unit_test(test_parts_of_other_shapes_keep_their_pose),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
