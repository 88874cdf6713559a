/* Which command goes on from a fit: none where it does not help. Tests: fit_next.c fit_refusal.c */
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

double cli_fit_map_voxel(const cli_fit *f) { return f->source.grid.spacing[0]; }

double cli_fit_finer_voxel(const cli_fit *f) { return f->result.advised_voxel_mm; }

/* The first two lines that are printed after a fit with these findings, of a radius that the data
 * determine and a spout that they do not. */
static const char *lines_after(const sdm_fit_finding *findings, size_t n, double advised_voxel)
{
    static char lines[2000];
    static const sdm_param params[2] = {{"radius", "mm", 4, 6, 5, ""},
                                        {"spout", "mm", 4, 6, 5, ""}};
    static const cli_args args;
    double p[2] = {5, 5}, sd[2] = {0.01, 0.9}, prior_sd[2] = {1, 1};
    cli_fit f = {.args = &args,
                 .params = (sdm_param *)params,
                 .n_params = 2,
                 .source.grid = {.n = {10, 10, 10}, .spacing = {1, 1, 1}},
                 .opts = sdm_fit_defaults(),
                 .doubt.status = SDM_E_QUALITY,
                 .result = {.params = p,
                            .sd = sd,
                            .prior_sd = prior_sd,
                            .n_iterations = 60,
                            .advised_voxel_mm = advised_voxel,
                            .verdict = {.n_findings = n, .grade = SDM_FIT_FAILED}}};
    for (size_t i = 0; i < n; i++) {
        f.result.verdict.findings[i] = findings[i];
        if (findings[i].kind != SDM_FIT_CHECK_CONVERGED) f.result.converged = true;
    }
    int before;
    FILE *file = captured_begin(&before);
    cli_fit_print_next(&f);
    captured_end(file, before);
    lines[fread(lines, 1, sizeof lines - 1, file)] = '\0';
    fclose(file);
    return lines;
}

static const char *after_unfinished(const char *text)
{
    sdm_fit_finding x = {.kind = SDM_FIT_CHECK_CONVERGED, .grade = SDM_FIT_FAILED};
    snprintf(x.text, sizeof x.text, "not converged after 60 iterations (%s", text);
    return lines_after(&x, 1, NAN);
}

static void unfinished_fits(void **state)
{
    (void)state;
    // what moves may come to its place; known values are another way
    const char *lines = after_unfinished("..; rotation about z still moves by 2 of its standard "
                                         "deviation): more of them, or known values of spout, "
                                         "which the data hardly determine");
    if (strncmp(lines, "more iterations from here:\n", 27) ||
        !strstr(lines, " --max-iterations=240 "))
        fail_msg("%s", lines);
    // what goes to and fro does not
    lines = after_unfinished("..; rotation about z still goes to and fro by 0.2 of its standard "
                             "deviation): the data hardly determine spout: keep it");
    if (!strstr(lines, " --keep=spout -p spout=VALUE ") || strstr(lines, "max-iterations"))
        fail_msg("%s", lines);
    assert_string_equal(after_unfinished("..; rotation about z still goes to and fro by 0.2 of its "
                                         "standard deviation): a nearer start"),
                        "");
}

static void finer_maps(void **state)
{
    (void)state;
    sdm_fit_finding x[2] = {{.kind = SDM_FIT_CHECK_RESIDUALS, .grade = SDM_FIT_FAILED},
                            {.kind = SDM_FIT_CHECK_VOXELS, .grade = SDM_FIT_DOUBTFUL}};
    static const char *const other[2] = {
        "they deviate by 9 times what noise explains: another shape lies there, or the voxels of "
        "the maps, 1 mm, are coarse beside the details",
        "they deviate by 9 times what noise explains: the fit is not on the shape of the labels: a "
        "wrong start, or another shape"};
    strcpy(x[0].text, "they deviate by 2 times what noise explains: the voxels of the maps, 1 mm, "
                      "are coarse beside the details, or another shape lies there");
    const char *lines = lines_after(x, 2, 0.5);
    if (!strstr(lines, "finer maps from here; ") || !strstr(lines, " --spacing=0.5 "))
        fail_msg("%s", lines);
    for (int i = 0; i < 2; i++) {
        strcpy(x[0].text, other[i]);
        assert_string_equal(lines_after(x, 2, 0.5), "");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(unfinished_fits),
                                       cmocka_unit_test(finer_maps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
