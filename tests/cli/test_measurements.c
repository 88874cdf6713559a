/* The measurements that are printed above the verdict on a training. Tests: report_verdict.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/captured.h"
#include "report/report_verdict.h"

static const char OTHER[] =
    "; `info` states 7.8 %, because it counts a derivative as at least 5 % of the volume";

/* Is OTHER printed if the derivative of the volume by `rise` errs by so much of itself, and by
 * `error` with small derivatives counted as larger ones? */
static bool tells_other(double own, double error)
{
    sdm_verdict v = {.volume_error = NAN,
                     .surface_volume_error = NAN,
                     .derivative_error = 0.1,
                     .derivative_by = "rise",
                     .derivative_shapes = 8,
                     .volume_own_error = own,
                     .volume_own_by = "rise",
                     .volume_derivative_error = error,
                     .fall = NAN,
                     .thin = NAN,
                     .motion_mm = NAN};
    char text[4096] = "";
    int before;
    FILE *file = captured_begin(&before);
    cli_print_measurements(&v);
    captured_end(file, before);
    assert_true(fread(text, 1, sizeof text - 1, file) > 0);
    fclose(file);
    assert_non_null(strstr(text, ", of volumes by 13 % (by rise)"));
    return strstr(text, OTHER);
}

// `info` and the model file state the second figure: a user who sees both learns why they differ.
static void test_two_figures_of_volumes(void **state)
{
    (void)state;
    assert_true(tells_other(0.13, 0.078));
    assert_false(tells_other(0.13, 0.13));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_two_figures_of_volumes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
