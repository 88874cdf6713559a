/* The lines `next`, `better` and `faster` below the verdict on a training. Tests: next_command.c
 * next_training.c other_kind.c
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/captured.h"
#include "train/next_training.h"
#include "train/other_kind.h"

#define COMPARE "--compare run/model.sdm\n"

typedef struct printer {
    const sdm_train_report *r;
    double minutes;
    const cli_timing *times; /* of cli_print_pod(); NULL: cli_print_next() */
} printer;

/* text, second = the first two lines that the function prints; "": nothing. */
static void lines_of(printer p, char text[512], char second[512])
{
    const char *words[] = {"can.yaml", "train.minutes=1"};
    const cli_args args = {.files = {.items = words, .n = 2}};
    int before;
    FILE *file = captured_begin(&before);
    if (p.times)
        cli_print_pod(&args, p.r, p.times, p.minutes);
    else
        cli_print_next(&args, p.r, "template", 1, p.minutes);
    captured_end(file, before);
    if (!fgets(text, 512, file)) text[0] = '\0';
    if (!fgets(second, 512, file)) second[0] = '\0';
    fclose(file);
}

static void next_lines(const sdm_train_report *r, double minutes, char text[512], char second[512])
{
    lines_of((printer){.r = r, .minutes = minutes}, text, second);
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
         "  next        sdmgen train can.yaml train.minutes=4 network.kind=pod --out "
         "run-2 " COMPARE},
        {false, 0, 2,
         "  next        sdmgen train can.yaml train.minutes=2 network.kind=pod --out "
         "run-2 " COMPARE},
        {false, 0, 0,
         "  next        sdmgen train can.yaml train.minutes=1 network.kind=pod --out "
         "run-2 " COMPARE},
        {true, 1.2, 2,
         "  next        no training is known to help near the surface: pod, which auto has "
         "trained, too, is 3 times worse there; exact maps (sdmgen exact, fit --exact) have no "
         "such error\n"}};
    char text[512], second[512];
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
        next_lines(&r, cases[i].minutes, text, second);
        assert_string_equal(text, cases[i].line);
    }
    // a good one needs nothing
    const sdm_train_report good = {
        .model_path = "run/model.sdm",
        .verdict = {.limited = true, .limit = SDM_CAUSE_FAR, .voxel_mm = 3.5, .dice = 0.99}};
    next_lines(&good, 2, text, second);
    assert_string_equal(text,
                        "  better      nothing needs to change: the error at the surface is 0 "
                        "voxels, and there is no line `not for`\n");
}

// A grid for the first use in `not for` comes before the key of the verdict, and says so. The time
// of a map is told for the same grid alone.
static void grid_or_key(void **state)
{
    (void)state;
    char text[512], second[512];
    sdm_train_report r = {.model_path = "run/model.sdm",
                          .steps = 1000,
                          .verdict = {.limited = true,
                                      .limit = SDM_CAUSE_BASES,
                                      .grade = SDM_GRADE_GOOD,
                                      .voxel_mm = 3,
                                      .coarse_mm = 3,
                                      .rmse_voxel_mm = 0.024,
                                      .dice = 0.99,
                                      .thickness_mm = 6.3,
                                      .key = "network.rank",
                                      .from = 9,
                                      .to = 18}};
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "  better      sdmgen train can.yaml grid=auto grid.spacing=1.2 "
                              "train.minutes=16 network.kind=template --out run-2 " COMPARE);
    assert_string_equal(second,
                        "              (the finer grid is for fits by the network alone, "
                        "see `not for`: sdmgen fit --shape needs no network; it has 16 times "
                        "the voxels; network.rank can wait, because the error at the "
                        "surface is only 0.008 voxels)\n");
    r.verdict.thickness_mm = 30;
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "  better      network.rank can wait: the error at the surface is "
                              "0.008 voxels, and there is no line `not for`\n");
    r.verdict.rmse_voxel_mm = 0.1;
    next_lines(&r, 1, text, second);
    assert_string_equal(second,
                        "              (the kind stays template, whose maps take 1 ms; without "
                        "network.kind=template auto chooses again)\n");
    strcpy(r.verdict.key, "grid.spacing");
    next_lines(&r, 1, text, second);
    assert_string_equal(second, "              (the kind stays template; without "
                                "network.kind=template auto chooses again)\n");
}

// auto had no time for a trial of template: no command fixes the kind, whatever the key is, and its
// minutes hold the trials of both kinds, which take longer with more voxels.
static void kind_stays_open(void **state)
{
    (void)state;
    static const struct {
        const char *key, *changes;
        double from, to, minutes;
        const char *alone;
    } cases[] = {{"train.minutes", "train.minutes=10.5", 2, 4, 0, "4"},
                 {"train.minutes", "train.minutes=12", 2, 12, 0, ""},
                 {"network.rank", "network.rank=18 train.minutes=10.5", 9, 18, 0, ""},
                 {"network.rank", "network.rank=18 train.minutes=14", 9, 18, 14, ""},
                 {"grid.spacing", "grid=auto grid.spacing=1.5 train.minutes=84", 3, 1.5, 16, "16"},
                 {"", "train.minutes=10.5", 0, 0, 0, ""}};
    char text[512], second[512], expected[512];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_train_report r = {.model_path = "run/model.sdm",
                              .steps = 1000,
                              .kind = SDM_NETWORK_POD,
                              .chosen = true,
                              .trial_minutes = 10.5,
                              .verdict = {.limited = true,
                                          .limit = SDM_CAUSE_NETWORK,
                                          .grade = SDM_GRADE_USABLE,
                                          .voxel_mm = 3,
                                          .coarse_mm = 3,
                                          .rmse_voxel_mm = 0.4,
                                          .dice = 0.97,
                                          .thickness_mm = 30,
                                          .from = cases[i].from,
                                          .to = cases[i].to,
                                          .minutes = cases[i].minutes}};
        strcpy(r.verdict.key, cases[i].key);
        next_lines(&r, 2, text, second);
        snprintf(expected, sizeof expected,
                 "  next        sdmgen train can.yaml %s --out run-2 " COMPARE, cases[i].changes);
        assert_string_equal(text, expected);
        snprintf(expected, sizeof expected,
                 "              (network.kind stays auto: this run had no time to try template; at "
                 "its pace the train.minutes of this command are enough for both kinds%s%s%s)\n",
                 cases[i].alone[0] ? "; with network.kind=pod " : "", cases[i].alone,
                 cases[i].alone[0] ? " are enough" : "");
        assert_string_equal(second, expected);
        // a kind that was tried needs no other trial
        r.tried = true;
        next_lines(&r, 2, text, second);
        assert_true(!cases[i].key[0] ||
                    strstr(text, " network.kind=template --out run-2 " COMPARE));
    }
}

// The same of a good model whose command mends a use.
static void finer_grid_leaves_kind_open(void **state)
{
    (void)state;
    char text[512], second[512];
    const sdm_train_report r = {.model_path = "run/model.sdm",
                                .steps = 1000,
                                .kind = SDM_NETWORK_POD,
                                .chosen = true,
                                .trial_minutes = 10.5,
                                .verdict = {.grade = SDM_GRADE_GOOD,
                                            .voxel_mm = 3,
                                            .coarse_mm = 3,
                                            .rmse_voxel_mm = 0.03,
                                            .dice = 0.99,
                                            .thickness_mm = 7.9}};
    next_lines(&r, 2, text, second);
    assert_string_equal(text, "  better      sdmgen train can.yaml grid=auto grid.spacing=1.5 "
                              "train.minutes=84 --out run-2 " COMPARE);
    assert_string_equal(second,
                        "              (network.kind stays auto: this run had no time to "
                        "try template; at its pace the train.minutes of this command are "
                        "enough for both kinds; with network.kind=pod 16 are enough; the finer "
                        "grid is for fits by the network alone, see `not for`: sdmgen fit --shape "
                        "needs no network; it has 8 times the "
                        "voxels; nothing else needs to change, because the error at the surface is "
                        "only 0.01 voxels)\n");
}

// auto took pod because it had no time for a template that needs no training: that one comes first,
// without a longer training, on the grid that the verdict or a use asks for.
static void skipped_template_comes_first(void **state)
{
    (void)state;
    static const struct {
        sdm_grade grade;
        double rmse_voxel_mm, thickness_mm;
        const char *key, *first, *second;
    } cases[] = {
        {SDM_GRADE_USABLE, 0.4, 30, "network.rank",
         "  next        sdmgen train can.yaml "
         "train.minutes=1 network.kind=template --out run-2 " COMPARE,
         "about 24 s and is mostly the better kind for a shape of several parts; if its "
         "line `before` says worse, change the key that `verdict` names here)\n"},
        {SDM_GRADE_USABLE, 0.4, 30, "grid.spacing",
         "  next        sdmgen train can.yaml "
         "train.minutes=1 grid=auto grid.spacing=1.5 network.kind=template --out run-2 " COMPARE,
         "about 192 s and is"},
        {SDM_GRADE_GOOD, 0.03, 7.9, "network.rank",
         "  better      sdmgen train can.yaml "
         "train.minutes=1 grid=auto grid.spacing=1.5 network.kind=template --out run-2 " COMPARE,
         "about 192 s and is mostly the better kind for a shape of several parts; the finer "
         "grid is for fits by the network alone"},
        {SDM_GRADE_GOOD, 0.03, 30, "network.rank",
         "  better      network.rank can wait: the error "
         "at the surface is 0.01 voxels, and there is no line `not for`\n",
         ""}};
    char text[512], second[512];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const double from = cases[i].key[0] == 'g' ? 3 : 9;
        sdm_train_report r = {.model_path = "run/model.sdm",
                              .steps = 1000,
                              .kind = SDM_NETWORK_POD,
                              .chosen = true,
                              .trial_minutes = 10.5,
                              .template_seconds = 24,
                              .verdict = {.limited = true,
                                          .limit = SDM_CAUSE_BASES,
                                          .grade = cases[i].grade,
                                          .voxel_mm = 3,
                                          .coarse_mm = 3,
                                          .rmse_voxel_mm = cases[i].rmse_voxel_mm,
                                          .dice = 0.99,
                                          .thickness_mm = cases[i].thickness_mm,
                                          .from = from,
                                          .to = from == 3 ? 1.5 : 18,
                                          .minutes = 7}};
        strcpy(r.verdict.key, cases[i].key);
        next_lines(&r, 2, text, second);
        assert_string_equal(text, cases[i].first);
        if (!strstr(second, cases[i].second)) fail_msg("%s", second);
    }
}

// auto kept a template and had no time for a trial of pod: near the surface the trials of both come
// before a long training of pod; a finer grid keeps the template, which needs no training.
static void trials_come_before_a_long_training(void **state)
{
    (void)state;
    char text[512], second[512];
    sdm_train_report r = {.model_path = "run/model.sdm",
                          .kind = SDM_NETWORK_TEMPLATE,
                          .chosen = true,
                          .trial_minutes = 3,
                          .pod_minutes = 20,
                          .verdict = {.limited = true,
                                      .limit = SDM_CAUSE_FAR,
                                      .grade = SDM_GRADE_USABLE,
                                      .voxel_mm = 3,
                                      .coarse_mm = 3,
                                      .rmse_voxel_mm = 0.4,
                                      .dice = 0.97,
                                      .thickness_mm = 30}};
    next_lines(&r, 1, text, second);
    assert_string_equal(text,
                        "  next        sdmgen train can.yaml train.minutes=3 --out run-2 " COMPARE);
    assert_string_equal(second,
                        "              (auto had no time for pod: this train.minutes is enough to "
                        "try both kinds; a training of pod alone asks for 20)\n");
    // its trial is known: nothing is left but the training
    r.unfinished = true, r.tried = true;
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "  next        sdmgen train can.yaml train.minutes=20 "
                              "network.kind=pod --out run-2 " COMPARE);
    r.unfinished = r.tried = false;
    r.verdict.grade = SDM_GRADE_GOOD, r.verdict.rmse_voxel_mm = 0.03, r.verdict.dice = 0.99;
    r.verdict.thickness_mm = 7.9;
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "  better      sdmgen train can.yaml train.minutes=1 grid=auto "
                              "grid.spacing=1.5 network.kind=template --out run-2 " COMPARE);
    assert_null(strstr(second, "both kinds"));
    // it errs a little and far away: no key is known to help, and no distance is promised
    r.verdict.rmse_voxel_mm = 0.09, r.verdict.thickness_mm = 30;
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "");
}

// A warning about a part that is too thin for the grid comes before what the verdict advises.
static void thin_part_comes_first(void **state)
{
    (void)state;
    char text[512], second[512];
    sdm_train_report r = {.model_path = "run/model.sdm",
                          .steps = 1000,
                          .verdict = {.limited = true,
                                      .limit = SDM_CAUSE_BASES,
                                      .grade = SDM_GRADE_USABLE,
                                      .voxel_mm = 3,
                                      .coarse_mm = 3,
                                      .rmse_voxel_mm = 0.4,
                                      .dice = 0.97,
                                      .thickness_mm = 30,
                                      .key = "network.rank",
                                      .from = 9,
                                      .to = 18}};
    const sdm_train_report before = r;
    cli_show_part_first(&r, NAN, 2);
    cli_show_part_first(&r, 3, 2);
    assert_memory_equal(&r, &before, sizeof r);
    cli_show_part_first(&r, 1.5, 2);
    next_lines(&r, 2, text, second);
    assert_string_equal(text, "  next        sdmgen train can.yaml grid=auto grid.spacing=1.5 "
                              "train.minutes=16 network.kind=template --out run-2 " COMPARE);
    if (strstr(r.verdict.sentence, "network.rank") ||
        !strstr(r.verdict.sentence, "lower grid.spacing from 3 to 1.5") ||
        !strstr(r.verdict.sentence, "train.minutes from 2 to 16"))
        fail_msg("%s", r.verdict.sentence);
}

// A key that the verdict names for the error may leave the uses in `not for` as they are: the note
// does not promise them.
static void uses_are_not_promised(void **state)
{
    (void)state;
    char text[512], second[512];
    sdm_train_report r = {.model_path = "run/model.sdm",
                          .steps = 1000,
                          .verdict = {.limited = true,
                                      .limit = SDM_CAUSE_NETWORK,
                                      .grade = SDM_GRADE_USABLE,
                                      .voxel_mm = 3,
                                      .coarse_mm = 3,
                                      .rmse_voxel_mm = 0.4,
                                      .dice = 0.97,
                                      .thickness_mm = 30,
                                      .derivatives_bad = "bit: off by 86 %",
                                      .key = "network.width",
                                      .from = 128,
                                      .to = 256}};
    next_lines(&r, 2, text, second);
    assert_non_null(strstr(second, "; this change makes distances better; the uses in "
                                   "`not for` may need another change)\n"));
    strcpy(r.verdict.key, "grid.spacing");
    next_lines(&r, 2, text, second);
    assert_non_null(strstr(second, "; derivatives of maps may need another change)\n"));
    r.verdict.derivatives_bad[0] = '\0';
    next_lines(&r, 2, text, second);
    assert_null(strstr(second, "another change"));
}

// Without another fault a good model needs nothing but the grid for the use that it leaves out; a
// verdict that names weights, and so no number, is not contradicted.
static void finer_grid_alone(void **state)
{
    (void)state;
    char text[512], second[512];
    sdm_train_report r = {.model_path = "run/model.sdm",
                          .steps = 1000,
                          .verdict = {.grade = SDM_GRADE_GOOD,
                                      .voxel_mm = 3,
                                      .coarse_mm = 3,
                                      .rmse_voxel_mm = 0.03,
                                      .dice = 0.99,
                                      .thickness_mm = 30}};
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "  better      nothing needs to change: the error at the surface is "
                              "0.01 voxels, and there is no line `not for`\n");
    r.verdict.limited = true, r.verdict.limit = SDM_CAUSE_ROUNDING;
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "  better      network.weights can wait: the error at the surface is "
                              "0.01 voxels, and there is no line `not for`\n");
    // no grid mends derivatives of the volume where faces lie along planes of voxels
    r.verdict.limited = false;
    strcpy(r.verdict.volume_derivatives_bad, "height: off by 28 %");
    r.verdict.volume_derivative_voxels = 0.25;
    next_lines(&r, 1, text, second);
    assert_string_equal(text, "");
}

// A pod that auto has trained, too, and that takes less than a fifth of the template's time is
// named with its errors and its file; one that takes more, or is poor, is not.
static void faster_pod(void **state)
{
    (void)state;
    char text[512], second[512];
    const cli_timing times = {.ms_network = 5, .ms_exact = 50};
    sdm_train_report r = {.model_path = "run/model.sdm",
                          .kind = SDM_NETWORK_TEMPLATE,
                          .compared = true,
                          .other = {.rmse_mm = 0.03},
                          .other_voxel_mm = 0.05,
                          .other_ms = 0.5,
                          .other_grade = SDM_GRADE_GOOD,
                          .other_path = "run/model-pod.sdm",
                          .verdict = {.grade = SDM_GRADE_GOOD, .voxel_mm = 3, .dice = 0.99}};
    const printer p = {.r = &r, .minutes = 1, .times = &times};
    lines_of(p, text, second);
    assert_string_equal(text, "  faster      a map of pod takes 0.5 ms, 10 times less than one of "
                              "this template, with RMSE 0.03 mm, within a voxel of the surface "
                              "0.05 mm\n");
    assert_string_equal(second, "              pod is run/model-pod.sdm (good)\n");
    r.other_ms = 1.1;
    lines_of(p, text, second);
    assert_string_equal(text, "");
    r.other_ms = 0.5, r.other_grade = SDM_GRADE_POOR;
    lines_of(p, text, second);
    assert_string_equal(text, "");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(template_that_errs_near_the_surface),
                                       cmocka_unit_test(grid_or_key),
                                       cmocka_unit_test(kind_stays_open),
                                       cmocka_unit_test(finer_grid_leaves_kind_open),
                                       cmocka_unit_test(skipped_template_comes_first),
                                       cmocka_unit_test(trials_come_before_a_long_training),
                                       cmocka_unit_test(uses_are_not_promised),
                                       cmocka_unit_test(thin_part_comes_first),
                                       cmocka_unit_test(finer_grid_alone),
                                       cmocka_unit_test(faster_pod)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
