/* Where the iterations of a fit end: a hundredth of a standard deviation is enough, unless the
 * options ask for more. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"

static void small_steps_end_a_fit(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 3);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    assert_true(o.eps_sd == 0.01);
    sdm_fit_result soon = fit(&t, &o);
    o.eps_sd = 0;
    sdm_fit_result late = fit(&t, &o);
    assert_true(soon.converged && late.converged);
    assert_non_null(strstr(soon.reason, "moves no unknown by more than 0.01 of its standard"));
    assert_non_null(strstr(late.reason, "below 3e-06"));
    assert_true(soon.n_iterations < late.n_iterations);
    for (size_t k = 0; k < 3; k++)
        if (!(fabs(soon.params[k] - late.params[k]) < 0.05 * late.sd[k]))
            fail_msg("parameter %zu: %.8g, later %.8g +- %.2g", k, soon.params[k], late.params[k],
                     late.sd[k]);
    for (size_t k = 0; k < 3; k++)
        assert_true(fabs(soon.pose.translation[k] - late.pose.translation[k]) <
                    0.05 * late.sd[6 + k]);
    sdm_fit_dispose(&soon);
    sdm_fit_dispose(&late);
    // a share below 0 is refused
    const sdm_fit_source source = exact_source();
    sdm_error err = {0};
    o.eps_sd = -1;
    assert_int_equal(sdm_fit(&source, &t, &o, &late, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "eps_sd"));
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(small_steps_end_a_fit)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
