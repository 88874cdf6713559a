/* Which parameters of a fit to a part of a shape can be used. Tests: fit_usable.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "fit/fit_command.h"
#include "oracle/captured.h"

enum { N = 5 };

// One parameter for each reason; the range of all is 2 mm, whose uniform distribution has the
// standard deviation 0.577.
static void values_that_the_data_do_not_tell(void **state)
{
    (void)state;
    static const sdm_param params[N] = {{"radius", "mm", 4, 6, 5, ""},
                                        {"wall", "mm", 4, 6, 5, ""},
                                        {"neck", "mm", 4, 6, 5, ""},
                                        {"height", "mm", 4, 6, 5, ""},
                                        {"reach", "mm", 4, 6, 5, ""}};
    double sd[N] = {0.55, 0.6, 0.1, 0.1, 0.1};
    enum { SIZE = N + 6 };
    double correlation[SIZE * SIZE] = {0};
    bool by_prior[N] = {[2] = true}, at_bound[N] = {[3] = true};
    cli_fit f = {.params = (sdm_param *)params,
                 .n_params = N,
                 .result = {.sd = sd,
                            .correlation = correlation,
                            .by_prior = by_prior,
                            .at_bound = at_bound,
                            .verdict = {.n_findings = 1}}};
    sdm_fit_finding *covered = &f.result.verdict.findings[0];
    covered->kind = SDM_FIT_CHECK_COVERED, covered->grade = SDM_FIT_DOUBTFUL;
    strcpy(covered->text, "the data hardly determine reach: no points lie near it");
    sdm_json json = {0};
    cli_fit_json_usable(&f, &json);
    if (!strstr(json.text.data, "[\"radius\"]")) fail_msg("%s", json.text.data);
    sdm_json_dispose(&json);
    // the line `use`
    char line[128] = "";
    int before;
    FILE *file = captured_begin(&before);
    cli_fit_print_usable(&f);
    captured_end(file, before);
    if (!fgets(line, sizeof line, file)) line[0] = '\0';
    fclose(file);
    assert_string_equal(line, "  use          radius; do not use wall, neck, height, reach\n");
    // only the sum of the radius and the reach is known
    correlation[4] = correlation[4 * SIZE] = -0.96;
    json = (sdm_json){0};
    cli_fit_json_usable(&f, &json);
    if (!strstr(json.text.data, "[]")) fail_msg("%s", json.text.data);
    sdm_json_dispose(&json);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(values_that_the_data_do_not_tell)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
