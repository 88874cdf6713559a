/* The line `next` of a template that errs near the surface: pod, with more minutes where auto has
 * given it a part of them, or none where it was much worse. Tests: next_training.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "next_training.h"

/* text = the first line that cli_print_next() prints; "": nothing. */
static void next_line(const sdm_train_report *r, double minutes, char text[512])
{
    const char *words[] = {"can.yaml", "train.minutes=1"};
    const cli_args args = {.files = {.items = words, .n = 2}};
    FILE *file = tmpfile();
    fflush(stdout);
    const int before = dup(STDOUT_FILENO);
    assert_true(file && before >= 0 && dup2(fileno(file), STDOUT_FILENO) >= 0);
    cli_print_next(&args, r, "template", 1, minutes);
    fflush(stdout);
    dup2(before, STDOUT_FILENO);
    close(before);
    rewind(file);
    if (!fgets(text, 512, file)) text[0] = '\0';
    fclose(file);
}

static void template_that_errs_near_the_surface(void **state)
{
    (void)state;
    static const struct {
        bool compared;
        double other_mm, minutes;
        const char *line;
    } cases[] = {
        {true, 0.43, 2,
         "  next        sdmgen train can.yaml train.minutes=4 network.kind=pod --out run-2\n"},
        {false, 0, 2,
         "  next        sdmgen train can.yaml train.minutes=2 network.kind=pod --out run-2\n"},
        {false, 0, 0,
         "  next        sdmgen train can.yaml train.minutes=1 network.kind=pod --out run-2\n"},
        {true, 1.2, 2,
         "  next        no training is known to help near the surface: pod, which auto has "
         "trained, too, is 3 times worse there; exact maps (sdmgen exact, fit --exact) have no "
         "such error\n"}};
    char text[512];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const sdm_train_report r = {.model_path = "run/model.sdm",
                                    .compared = cases[i].compared,
                                    .other_voxel_mm = cases[i].other_mm,
                                    .verdict = {.limited = true,
                                                .limit = SDM_CAUSE_FAR,
                                                .grade = SDM_GRADE_USABLE,
                                                .voxel_mm = 3.5,
                                                .rmse_voxel_mm = 0.4,
                                                .dice = 0.97}};
        next_line(&r, cases[i].minutes, text);
        assert_string_equal(text, cases[i].line);
    }
    // a good one needs nothing
    const sdm_train_report good = {
        .model_path = "run/model.sdm",
        .verdict = {.limited = true, .limit = SDM_CAUSE_FAR, .voxel_mm = 3.5, .dice = 0.99}};
    next_line(&good, 2, text);
    assert_string_equal(text, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(template_that_errs_near_the_surface)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
