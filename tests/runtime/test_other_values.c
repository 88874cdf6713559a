/* A goblet: a ball on a thin stem with a flat foot. A fit to labels that starts with a stem twice
 * as long brings the ball to its place and leaves the foot in the air beyond the labels, where no
 * small change of the stem brings it nearer. It goes on from another value of the stem. Tests:
 * other_values.c principal_axes.c start_list.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"
#include "oracle/revolved.h"

enum { STEM, BALL, GOBLET_PARAMS };
static const sdm_param goblet_params[GOBLET_PARAMS] = {
    {"stem", "mm", 10, 40, 38, "from the foot to the ball"},
    {"ball", "mm", 5, 8, 6, "radius of the ball"}};

enum { RINGS = 96, AROUND = 24 };
static const double ROD = 1.2, FOOT = 6, FOOT_HEIGHT = 1.6;

// The middle of the ball is the origin; the foot ends below the stem.
static double bottom(const double *p) { return -p[BALL] - p[STEM] - FOOT_HEIGHT; }

static void goblet_ring(const double *p, int i, double *r, double *z)
{
    *z = bottom(p) + (p[BALL] - bottom(p)) * (i + 1) / (RINGS + 1);
    const double ball = fabs(*z) < p[BALL] ? sqrt(p[BALL] * p[BALL] - *z * *z) : 0;
    *r = *z < bottom(p) + FOOT_HEIGHT ? FOOT : *z < 0 ? fmax(ball, ROD) : ball;
}

static int goblet_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                       const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    return revolved_mesh(host, out, RINGS, AROUND, goblet_ring, p, bottom(p), p[BALL]);
}

static const sdm_shape goblet = {.abi = SDM_SHAPE_ABI,
                                 .size = sizeof(sdm_shape),
                                 .name = "goblet",
                                 .summary = "a ball on a stem with a foot",
                                 .params = goblet_params,
                                 .n_params = GOBLET_PARAMS,
                                 .mesh = goblet_mesh};

/* Fits the labels of a goblet with this stem, from a stem of 38 mm in its pose. */
static sdm_status fit_goblet(double stem, sdm_fit_result *r, sdm_error *err)
{
    const double truth[GOBLET_PARAMS] = {stem, 6.5};
    const sdm_grid g = sdm_grid_centred((int64_t[3]){30, 30, 90}, 0.7, (double[3]){0, 0, -18});
    sdm_fit_opts o = sdm_fit_defaults();
    o.polish_eps = 1e-3;
    return fit_labels_of(&goblet, truth, &g, &o, r, err);
}

static void a_wrong_length_is_left(void **state)
{
    (void)state;
    static const double stem[] = {13, 18, 38};
    for (size_t i = 0; i < sizeof stem / sizeof *stem; i++) {
        sdm_fit_result r;
        sdm_error err;
        const sdm_status s = fit_goblet(stem[i], &r, &err);
        if (s || fabs(r.params[STEM] - stem[i]) > 0.3)
            fail_msg("stem %g: %g (%s)", stem[i], r.params ? r.params[STEM] : NAN, err.text);
        assert_true(fabs(r.params[BALL] - 6.5) < 0.1);
        assert_int_equal(r.verdict.grade == SDM_FIT_FAILED, 0);
        // one value of the objective for each iteration, over all attempts
        for (size_t k = 0; k < r.n_iterations; k++) assert_true(isfinite(r.objective[k]));
        sdm_fit_dispose(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_wrong_length_is_left)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
