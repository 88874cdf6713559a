/* The advice on the signs of x and y beside points of a pot, where they are nearly round: a fit in
 * the right pose gets none, although the pot lies near the points half a turn off, too; a fit half
 * a turn off gets it, with the scatter of both. Tests: fit_astray.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "fit/fit_command.h"
#include "oracle/fit_tools.h"
#include "oracle/pot.h"

// that of fit_target.c, which reads files
const char *cli_fit_kind(const cli_fit *f)
{
    (void)f;
    return "points";
}

static void advise(bool turned, char *text, size_t size)
{
    cli_args args = {.pose = {{0, 0, 0}, {NAN, NAN, NAN}}};
    args.fit.start_centre[0] = args.fit.start_centre[1] = args.fit.start_centre[2] = NAN;
    double points[3 * POT_POINTS];
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&pot, NULL, 0, NULL, &shape, NULL), SDM_OK);
    double start[POT_PARAMS] = {7, 9, 0.7};
    cli_fit f = {.args = &args,
                 .source = pot_source(shape),
                 .start = start,
                 .points = points,
                 .target = {.kind = SDM_FIT_POINTS, .points = points},
                 .opts = sdm_fit_defaults()};
    f.target.n_points = pot_points(shape, 1, false, points);
    if (turned) f.opts.start_pose.rotation[2] = 3.141592653589793;
    f.opts.polish_eps = 1e-3;
    f.opts.max_restarts = 0;
    const sdm_status s = sdm_fit(&f.source, &f.target, &f.opts, &f.result, &f.doubt);
    assert_true(s == SDM_OK || s == SDM_E_QUALITY);
    // as one that is refused for another reason
    f.found = true, f.doubt.status = SDM_E_QUALITY;
    assert_int_equal(cli_fit_astray(&f, text, size, NULL), SDM_OK);
    sdm_fit_dispose(&f.result);
    sdm_instance_free(shape);
}

static void the_right_pose_gets_no_advice(void **state)
{
    (void)state;
    char text[800];
    advise(false, text, sizeof text);
    assert_string_equal(text, "");
}

static void half_a_turn_is_told_with_the_scatter_of_both(void **state)
{
    (void)state;
    char text[800];
    double now = 0, was = 0;
    advise(true, text, sizeof text);
    if (sscanf(text,
               "; with x and y of the other sign the fit lies on the points (they scatter by %lf "
               "mm about it, not by %lf mm): either the start is turned by half a turn about z",
               &now, &was) != 2 ||
        !(fabs(now - 0.05) < 0.005) || !(was > 1.05 * now))
        fail_msg("%s", text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_right_pose_gets_no_advice),
        cmocka_unit_test(half_a_turn_is_told_with_the_scatter_of_both),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
