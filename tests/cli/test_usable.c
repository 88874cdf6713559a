/* Which parameters of a fit to a part of a shape can be used. and what the line `in
 * short` says. Tests: fit_usable.c, fit_verdict.c */
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

/* The voxels of finer maps that the fit advises; NaN: none. */
static double finer_voxel = NAN;

double cli_fit_finer_voxel(const cli_fit *f)
{
    (void)f;
    return finer_voxel;
}

/* A fit with its findings and what it knows of its N parameters. */
typedef struct judged {
    cli_fit f;
    double sd[N], correlation[(N + 6) * (N + 6)];
    bool by_prior[N], at_bound[N];
} judged;

static const sdm_param PARAMS[N] = {{"radius", "mm", 4, 6, 5, ""},
                                    {"wall", "mm", 4, 6, 5, ""},
                                    {"neck", "mm", 4, 6, 5, ""},
                                    {"height", "mm", 4, 6, 5, ""},
                                    {"reach", "mm", 4, 6, 5, ""}};

// *j = a fit that has passed; every standard deviation is 0.1
static void judged_create(judged *j, sdm_fit_kind kind)
{
    static const cli_args args = {0};
    *j = (judged){.sd = {0.1, 0.1, 0.1, 0.1, 0.1}};
    j->f = (cli_fit){.args = &args,
                     .params = (sdm_param *)PARAMS,
                     .n_params = N,
                     .target.kind = kind,
                     .result = {.sd = j->sd,
                                .correlation = j->correlation,
                                .by_prior = j->by_prior,
                                .at_bound = j->at_bound,
                                .advised_voxel_mm = NAN}};
}

static void doubts(judged *j, sdm_fit_check_kind kind, double figure, double limit,
                   const char *text)
{
    sdm_fit_finding x = {.kind = kind, .grade = SDM_FIT_DOUBTFUL, .figure = figure, .limit = limit};
    snprintf(x.text, sizeof x.text, "%s", text);
    sdm_fit_verdict_add(&j->f.result.verdict, &x);
}

// text[size] = the printed verdict
static void print_verdict(const judged *j, char *text, size_t size)
{
    int before;
    FILE *file = captured_begin(&before);
    cli_fit_print_verdict(&j->f);
    captured_end(file, before);
    text[fread(text, 1, size - 1, file)] = '\0';
    fclose(file);
}

#define SHOWS(j, words)                                                                            \
    do {                                                                                           \
        char shown_[2000];                                                                         \
        print_verdict(j, shown_, sizeof shown_);                                                   \
        if (!strstr(shown_, words)) fail_msg("no '%s' in:\n%s", words, shown_);                    \
    } while (0)

// A parameter at an end of its range beside a part that the data lack: `use` leaves it out, and
// what is known only together with it; not where the data want it beyond its range.
static void bounds_leave_the_others(void **state)
{
    (void)state;
    judged j;
    judged_create(&j, SDM_FIT_POINTS);
    doubts(&j, SDM_FIT_CHECK_COVERED, 0.3, 0.02, "the data hardly determine reach: no points");
    doubts(&j, SDM_FIT_CHECK_BOUNDS, 1, 0, "1 of 5 parameters at an end of their range (height)");
    j.at_bound[3] = true;
    SHOWS(&j, "  use          radius, wall, neck; do not use height, reach\n");
    SHOWS(&j, "a part of the shape: the line `use` names the values that can be used\n");
    j.correlation[3] = j.correlation[3 * (N + 6)] = 0.97;
    SHOWS(&j, "  use          wall, neck; do not use radius, height, reach\n");
    doubts(&j, SDM_FIT_CHECK_BOUNDS, 1, 0, "height ends at its bound: the data want more than 6");
    char text[2000];
    print_verdict(&j, text, sizeof text);
    if (strstr(text, "  use ")) fail_msg("%s", text);
}

// The data show all of the surface, and yet do not determine a parameter.
static void open_parameters_are_named(void **state)
{
    (void)state;
    judged j;
    judged_create(&j, SDM_FIT_LABEL);
    doubts(&j, SDM_FIT_CHECK_BOUNDS, 1, 0, "1 of 5 parameters at an end of their range (height)");
    j.at_bound[3] = true;
    char text[2000];
    print_verdict(&j, text, sizeof text);
    if (strstr(text, "  use ")) fail_msg("%s", text);
    j.by_prior[2] = true;
    SHOWS(&j, "  use          radius, wall, reach; do not use neck, height\n");
    SHOWS(&j, "the data do not determine every parameter: the line `use` names the values");
    doubts(&j, SDM_FIT_CHECK_RESIDUALS, 2, 1.3, "they deviate");
    print_verdict(&j, text, sizeof text);
    if (strstr(text, "  use ")) fail_msg("%s", text);
}

// No nearness of the values is promised where the maps are too coarse to test the shape.
static void coarse_maps_promise_nothing(void **state)
{
    (void)state;
    judged j;
    judged_create(&j, SDM_FIT_IMAGE);
    doubts(&j, SDM_FIT_CHECK_VOXELS, 0.6, 0.3, "coarse");
    SHOWS(&j,
          "  in short     the maps are too coarse to judge the shape: fit with finer ones before");
    doubts(&j, SDM_FIT_CHECK_MISSING, 0.06, 0.002, "12 voxels far from the surface");
    SHOWS(&j, "  in short     the maps are too coarse, or this is another shape: fit with finer");
}

// Residuals of 1.31 beside a limit of 1.3: the contour decides; of 1.5 they say more.
static void barely_above_a_limit(void **state)
{
    (void)state;
    judged j;
    judged_create(&j, SDM_FIT_IMAGE);
    finer_voxel = 0.2;
    doubts(&j, SDM_FIT_CHECK_INSIDE, 1.31, 1.3, "spread");
    SHOWS(&j,
          "  in short     barely above a limit, so the contour decides (-o fit.png): if it lies on "
          "the object, use the values, or fit with finer maps\n");
    finer_voxel = NAN;
    SHOWS(&j, " if it lies on the object, use the values\n");
    doubts(&j, SDM_FIT_CHECK_RESIDUALS, 1.5, 1.3, "they deviate");
    SHOWS(&j, "  in short     the data may differ from the shape ");
    judged_create(&j, SDM_FIT_IMAGE);
    doubts(&j, SDM_FIT_CHECK_NEXT_POSE, 2.95, 3, "another pose");
    SHOWS(&j, "  in short     the data may differ from the shape ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_that_the_data_do_not_tell),
        cmocka_unit_test(bounds_leave_the_others), cmocka_unit_test(open_parameters_are_named),
        cmocka_unit_test(coarse_maps_promise_nothing), cmocka_unit_test(barely_above_a_limit)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
