/* The verdict on a training: the decision from given figures, the measured parts, and that
 * following the advice makes the error smaller. Tests: judge.c verdict.c verdict_unfit.c
 * pod_parts.c tree_pass.c history.c progress.c
 * forecast.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "capsule_training.h"
#include "data/surface_check.h"
#include "sdm/internal/text.h"
#include "sdm/model.h"
#include "state/forecast.h"
#include "state/history.h"
#include "state/judge.h"
#include "state/progress.h"

/* A good model with a voxel of 0.8 mm, an error of 0.01 mm and no cause. */
static sdm_verdict figures(void)
{
    sdm_verdict v = {.voxel_mm = 0.8,
                     .rmse_mm = 0.01,
                     .rmse_voxel_mm = 0.01,
                     .dice = 0.99,
                     .dice_min = 0.98,
                     .fall = 0,
                     .modes_mm2 = 0};
    for (int i = 0; i < SDM_CAUSES; i++) v.part_mm2[i] = NAN;
    return v;
}

static sdm_verdict decide(const char *override, sdm_cause cause, double fall, double modes_mm2)
{
    const sdm_config c = config_of(&override, override ? 1 : 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500, .budget = 1000};
    sdm_verdict v = figures();
    v.part_mm2[SDM_CAUSE_BASES] = v.part_mm2[SDM_CAUSE_NETWORK] = v.part_mm2[SDM_CAUSE_MAPS] = 1e-5;
    v.part_mm2[cause] = 8e-5;
    v.fall = fall, v.modes_mm2 = modes_mm2;
    trainer_verdict_decide(&in, &v);
    assert_true(v.limited);
    assert_int_equal(v.limit, cause);
    return v;
}

// Four maps for each term of the polynomials, at most data.start; half of the time is for maps, and
// a third is left for steps.
static void minutes_hold_the_maps(void **state)
{
    (void)state;
    sdm_config c = config_of(NULL, 0);
    c.network.degree = 6, c.data.start = 3456;
    assert_true(trainer_maps_asked(&c, 4) == 840);
    assert_true(trainer_maps_asked(&c, 6) == 3456);
    assert_true(trainer_minutes_for(3456, 0.03, 0) == 3.5);
    assert_true(trainer_minutes_for(3456, 0.03, 103) == 5.5);
    assert_true(trainer_minutes_for(100, 0.01, 0) == 0.1);
}

// The largest part limits; its key, the doubled value and the rest of the error are in the
// sentence.
static void largest_part_limits(void **state)
{
    (void)state;
    static const struct {
        const char *override;
        sdm_cause cause;
        double fall, modes_mm2;
        const char *change;
    } cases[] = {
        {NULL, SDM_CAUSE_BASES, 0, 0, "raise network.rank from 8 to 16"},
        {"network.rank=200", SDM_CAUSE_BASES, 0, 0, "lower network.block from 4 to 2"},
        {NULL, SDM_CAUSE_NETWORK, 0.5, 0, "raise train.steps from 1000 to 2000"},
        {"train.learning_rate=0.3", SDM_CAUSE_NETWORK, 0.5, 0,
         "lower train.learning_rate from 0.3 to 0.003"},
        {NULL, SDM_CAUSE_NETWORK, 0.02, 0, "raise network.width from 32 to 64"},
        {NULL, SDM_CAUSE_NETWORK, NAN, 7e-5, "raise network.modes from 64 to 128"},
        {"network.depth=0", SDM_CAUSE_NETWORK, NAN, 0, "raise network.depth from 0 to 3"},
        {"network.width=4096", SDM_CAUSE_NETWORK, 0, 0, "raise network.depth from 2 to 3"},
        {NULL, SDM_CAUSE_MAPS, 0, 0, "raise data.start from 200 to 400"},
        {"data.online=900", SDM_CAUSE_MAPS, 0, 0, "raise data.online from 900 to 1800"},
        {"data.memory_gb=0.005", SDM_CAUSE_MAPS, 0, 0, "to 400 and data.memory_gb to 1;"},
        {NULL, SDM_CAUSE_ROUNDING, 0, 0, "set network.weights to f16"},
        {"network.weights=f16", SDM_CAUSE_ROUNDING, 0, 0, "set network.weights to f32"},
        {NULL, SDM_CAUSE_FAR, 0, 0,
         "nothing to change for surfaces, level sets and fits near the surface; where distances "
         "far away matter, set network.kind to pod (a finer grid does not change them)"},
        {NULL, SDM_CAUSE_TEMPLATE, 0, 0,
         "lower grid.spacing from 0.8 to 0.4 (and raise grid.size in proportion, if it is given)"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const sdm_verdict v =
            decide(cases[i].override, cases[i].cause, cases[i].fall, cases[i].modes_mm2);
        if (!strstr(v.sentence, cases[i].change)) fail_msg("case %zu: %s", i, v.sentence);
        // three parts of 1e-5 remain, two if one of them is the largest
        const double rest = cases[i].cause <= SDM_CAUSE_MAPS ? 2e-5 : 3e-5;
        assert_true(fabs(v.at_best_mm - sqrt(rest)) < 1e-12);
        char without[96];
        snprintf(without, sizeof without,
                 "; without this part alone the RMSE would be %.2g mm, not", sqrt(rest));
        assert_true(cases[i].cause == SDM_CAUSE_NETWORK || strstr(v.sentence, without));
    }
}

// A short training is short whether its error falls or not; one that patience has ended is not.
static void length_of_the_training(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    for (int k = 0; k < 3; k++) {
        sdm_verdict v = figures();
        v.part_mm2[SDM_CAUSE_NETWORK] = 1e-4;
        v.fall = k == 0 ? 0 : 0.5;
        const verdict_input in = {.config = &c,
                                  .maps = 200,
                                  .steps = k == 0 ? 60 : 1500,
                                  .ended_early = k == 2,
                                  .budget = (double)c.train.steps};
        trainer_verdict_decide(&in, &v);
        assert_string_equal(v.key, k == 2 ? "network.width" : "train.steps");
    }
    // too little time for the maps is a matter of time
    sdm_verdict v = figures();
    v.part_mm2[SDM_CAUSE_MAPS] = 1e-4;
    const verdict_input in = {
        .config = &c, .maps = 128, .steps = 1500, .cut = true, .budget = 1500};
    trainer_verdict_decide(&in, &v);
    assert_string_equal(v.key, "train.steps");
    // the advice is about the budget of the run, not about the part that this kind had
    assert_true(v.from == 1500 && v.to == 3000);
    sdm_config timed = c;
    timed.train.steps = 0, timed.train.minutes = 1.19;
    const verdict_input in_time = {.config = &timed, .maps = 200, .steps = 1500, .budget = 1.5};
    v = figures();
    v.part_mm2[SDM_CAUSE_NETWORK] = 1e-4;
    trainer_verdict_decide(&in_time, &v);
    assert_string_equal(v.key, "network.width");
    assert_true(v.minutes == 3);
    assert_non_null(strstr(v.sentence, "train.minutes from 1.5 to 3 for a larger network"));
    // less the time that patience has saved
    v = figures();
    v.part_mm2[SDM_CAUSE_NETWORK] = 1e-4;
    v.saved_seconds = 36;
    trainer_verdict_decide(&in_time, &v);
    assert_true(fabs(v.minutes - 2.4) < 1e-9);
    // minutes that hold the maps at the measured pace, where twice the budget would not, whichever
    // part limits
    static const struct {
        sdm_cause cause;
        double steps, asked, minutes;
    } few[] = {{SDM_CAUSE_MAPS, 1500, 5.5, 5.5},
               {SDM_CAUSE_MAPS, 1500, 2, 3},
               {SDM_CAUSE_NETWORK, 0, 7, 7},
               {SDM_CAUSE_BASES, 1500, 5.5, 5.5}};
    for (size_t k = 0; k < sizeof few / sizeof *few; k++) {
        verdict_input short_of_maps = in_time;
        short_of_maps.cut = true, short_of_maps.steps = few[k].steps;
        short_of_maps.minutes_asked = few[k].asked;
        v = figures();
        v.part_mm2[few[k].cause] = 1e-4;
        trainer_verdict_decide(&short_of_maps, &v);
        const bool bases = few[k].cause == SDM_CAUSE_BASES;
        assert_string_equal(v.key, bases ? "network.rank" : "train.minutes");
        assert_true((bases ? v.minutes : v.to) == few[k].minutes);
        assert_true(!bases || strstr(v.sentence, "train.minutes from 1.5 to 5.5 for the maps"));
    }
    v = figures();
    v.part_mm2[SDM_CAUSE_NETWORK] = 1e-4;
    v.saved_seconds = 90;
    trainer_verdict_decide(&in_time, &v);
    assert_true(v.minutes == 0 && !strstr(v.sentence, "train.minutes"));
    // a template without a correction is not trained: more voxels need no more minutes
    timed.network.kind = SDM_NETWORK_TEMPLATE;
    const verdict_input untrained = {.config = &timed, .budget = 1.5};
    v = figures();
    v.part_mm2[SDM_CAUSE_TEMPLATE] = 1e-4;
    trainer_verdict_decide(&untrained, &v);
    assert_string_equal(v.key, "grid.spacing");
    assert_true(v.minutes == 0 && !strstr(v.sentence, "train.minutes"));
}

// Where patience has ended the training the verdict does not say that its time was too short: the
// half of the budget for the maps may have been.
static void patience_left_time(void **state)
{
    (void)state;
    const char *overrides[] = {"train.steps=0", "train.minutes=2"};
    const sdm_config c = config_of(overrides, 2);
    for (int early = 0; early < 2; early++) {
        sdm_verdict v = figures();
        v.part_mm2[SDM_CAUSE_MAPS] = 1e-4;
        verdict_input in = {.config = &c,
                            .maps = 128,
                            .steps = 1500,
                            .cut = true,
                            .ended_early = early,
                            .budget = 2};
        trainer_verdict_decide(&in, &v);
        assert_true(!strcmp(v.key, "train.minutes") && v.to == 4);
        const char *why = early
                              ? "There are fewer maps than data.start, because they may take half "
                                "of train.minutes only. Their number limits the model (100 % of "
                                "the mean square error): raise train.minutes from 2 to 4"
                              : "There are fewer maps than data.start, because the time was too "
                                "short. Their number limits the model (100 % of the mean square "
                                "error): raise train.minutes from 2 to 4";
        assert_non_null(strstr(v.sentence, why));
        // few steps, but patience ended them
        v = figures();
        v.part_mm2[SDM_CAUSE_NETWORK] = 1e-4;
        in.steps = 60;
        trainer_verdict_decide(&in, &v);
        assert_string_equal(v.key, early ? "train.patience" : "train.minutes");
        if (early) assert_non_null(strstr(v.sentence, "raise train.patience from 0.3 to 0.6"));
        assert_int_equal(strstr(v.sentence, "too short, it made fewer than 500 steps") != NULL,
                         !early);
        v = figures();
        v.part_mm2[SDM_CAUSE_NETWORK] = 1e-4;
        in.steps = 0, in.ended_early = false;
        trainer_verdict_decide(&in, &v);
        assert_non_null(strstr(v.sentence, "too short, the maps left no time for steps"));
    }
}

// Where most of the maps in the time of the budget are those of the static grid, a smaller grid
// comes before a longer training; its new number is the largest with at most a third of the maps.
static void static_grid_took_the_time(void **state)
{
    (void)state;
    static const struct {
        const char *counts;
        double n_params, fixed, maps, steps;
        sdm_cause limit;
        const char *change;
    } cases[] = {
        {"data.static=4", 5, 1024, 1400, 1500, SDM_CAUSE_MAPS, "lower data.static from 4 to 3"},
        {"data.static=4", 5, 1024, 1400, 0, SDM_CAUSE_MAPS,
         "(99 % of the mean square error): lower"},
        {"data.static=4", 5, 1024, 1400, 60, SDM_CAUSE_NETWORK, "lower data.static from 4 to 3"},
        {"data.static=[5, 4, 4]", 3, 80, 150, 60, SDM_CAUSE_NETWORK, "data.static from 5 to 3"},
        {"data.static=2", 8, 256, 400, 1500, SDM_CAUSE_MAPS, "lower data.static from 2 to 0"},
        {"data.static=4", 5, 1024, 2100, 1500, SDM_CAUSE_MAPS, "raise train.minutes from 2 to 4"},
        {"data.static=4", 5, 1024, 1400, 1500, SDM_CAUSE_NETWORK, "raise network.width"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *overrides[] = {cases[i].counts, "train.steps=0", "train.minutes=2"};
        const sdm_config c = config_of(overrides, 3);
        sdm_verdict v = figures();
        v.part_mm2[SDM_CAUSE_NETWORK] = 1e-6;
        v.part_mm2[cases[i].limit] = 1e-4;
        const verdict_input in = {.config = &c,
                                  .maps = cases[i].maps,
                                  .fixed = cases[i].fixed,
                                  .n_params = cases[i].n_params,
                                  .cut = true,
                                  .steps = cases[i].steps,
                                  .budget = 2};
        trainer_verdict_decide(&in, &v);
        if (!strstr(v.sentence, cases[i].change)) fail_msg("case %zu: %s", i, v.sentence);
        assert_int_equal(strstr(v.sentence, "The static grid took most") == v.sentence, i < 5);
        assert_int_equal(strstr(v.sentence, "fewer than 500 steps") != NULL, cases[i].steps < 500);
    }
}

// The other kind is a choice, not a remedy. An error of less than a voxel, or near the
// surface, is not told with the grade.
static void error_far_from_the_surface(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500};
    sdm_verdict v = figures();
    v.part_mm2[SDM_CAUSE_TEMPLATE] = 1e-5, v.part_mm2[SDM_CAUSE_FAR] = 3e-5;
    trainer_verdict_decide(&in, &v);
    assert_int_equal(v.limit, SDM_CAUSE_FAR);
    assert_true(!v.key[0] &&
                strstr(v.sentence, "nothing to change for surfaces, level sets and fits near"));
    assert_non_null(strstr(v.sentence, "75 %"));
    v.largest_mm = 2, v.far_largest_mm = 0.9;
    assert_true(sdm_verdict_errs_far(&v));
    v.far_largest_mm = 0.7;
    assert_false(sdm_verdict_errs_far(&v));
    v.far_largest_mm = NAN; // no voxel is so far
    assert_false(sdm_verdict_errs_far(&v));
}

// Where the surface suffers, too, nothing says that it does not, and another kind is the remedy.
// Volumes of surfaces that voxels explain need a finer grid alone.
static void template_errs_near_the_surface(void **state)
{
    (void)state;
    static const struct {
        double voxels, volume, surface, cut;
        bool needs;
        const char *text;
    } cases[] = {
        {0.02, NAN, NAN, 0, false, ": nothing to change for surfaces, level sets and fits"},
        {0.114, 0.04, 0.038, 0, true,
         "(75 % of the mean square error): near the surface it errs, too, distances by 0.11 voxels "
         "and volumes by 4 %, and a finer grid does not mend this; set network.kind to pod, or use "
         "exact maps; without"},
        {0.114, 0.01, 0.01, 0, true, "too, distances by 0.11 voxels, and a finer grid does not"},
        {0.02, 0.03, 0.03, 0, true, "and volumes by 3 %"},
        {0.02, 0.005, 0.03, 0, false,
         ": nothing to change for level sets and fits near the surface, and a smaller grid.spacing "
         "for volumes of surfaces; where distances"},
        {0.02, NAN, NAN, 0.1, false, "): where distances far away matter, set network.kind to pod"},
        {0.114, NAN, NAN, 0.1, false, "distances by 0.11 voxels"}};
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_verdict v = figures();
        v.coarse_mm = v.voxel_mm, v.thickness_mm = 5;
        v.rmse_voxel_mm = cases[i].voxels * v.voxel_mm;
        v.volume_error = cases[i].volume, v.surface_volume_error = cases[i].surface;
        v.cut = cases[i].cut;
        v.part_mm2[SDM_CAUSE_TEMPLATE] = 1e-5, v.part_mm2[SDM_CAUSE_FAR] = 3e-5;
        trainer_verdict_decide(&in, &v);
        assert_int_equal(v.limit, SDM_CAUSE_FAR);
        assert_int_equal(sdm_verdict_needs_pod(&v), cases[i].needs);
        if (!strstr(v.sentence, cases[i].text)) fail_msg("case %zu: %s", i, v.sentence);
        assert_true(!v.key[0] && !strstr(v.sentence, "do not suffer"));
        assert_int_equal(!strstr(v.sentence, "nothing to change"), i != 0 && i != 4);
    }
}

// The grid limits if it errs twice as much as the model and more than a twentieth of a voxel: where
// the network is the larger part of the error of the surface, a finer grid is no remedy.
static void grid_limits(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500};
    static const struct {
        double model_mm, grid_mm;
        bool limits;
    } cases[] = {
        {0.01, 0.039, false}, {0.01, 0.041, true}, {0.05, 0.09, false}, {0.05, 0.11, true}};
    for (size_t i = 0; i < 4; i++) {
        sdm_verdict v = figures();
        v.rmse_voxel_mm = cases[i].model_mm;
        v.part_mm2[SDM_CAUSE_BASES] = 1e-4;
        v.part_mm2[SDM_CAUSE_GRID] = cases[i].grid_mm * cases[i].grid_mm;
        trainer_verdict_decide(&in, &v);
        assert_int_equal(v.limit == SDM_CAUSE_GRID, cases[i].limits);
        assert_string_equal(v.key, cases[i].limits ? "grid.spacing" : "network.rank");
    }
}

static void grades(void **state)
{
    (void)state;
    static const struct {
        double voxels, dice, cut;
        sdm_grade grade;
    } cases[] = {{0.049, 0.981, 0, SDM_GRADE_GOOD},      {0.051, 0.981, 0, SDM_GRADE_USABLE},
                 {0.049, 0.979, 0, SDM_GRADE_USABLE},    {0.19, 0.91, 0, SDM_GRADE_USABLE},
                 {0.21, 0.91, 0, SDM_GRADE_POOR},        {0.19, 0.89, 0, SDM_GRADE_POOR},
                 {0.049, 0.981, 0.04, SDM_GRADE_GOOD},   {0.049, 0.981, 0.06, SDM_GRADE_USABLE},
                 {0.049, 0.981, 0.49, SDM_GRADE_USABLE}, {0.049, 0.981, 0.51, SDM_GRADE_POOR}};
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_verdict v = figures();
        v.rmse_voxel_mm = cases[i].voxels * v.voxel_mm;
        v.dice = cases[i].dice;
        v.cut = cases[i].cut;
        trainer_verdict_decide(&in, &v);
        assert_int_equal(v.grade, cases[i].grade);
        // without any measured part
        assert_true(!v.limited && !v.key[0] && isnan(v.at_best_mm));
        assert_int_equal(strstr(v.sentence, "The grid cuts") == v.sentence, cases[i].cut > 0);
    }
}

// Few held-out shapes are told beside the grade and in the sentence.
static void few_heldout_shapes(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c};
    char text[SDM_GRADE_FEW];
    assert_string_equal(sdm_grade_few(1, text), " (from 1 shape only)");
    assert_string_equal(sdm_grade_few(9, text), " (from 9 shapes only)");
    assert_string_equal(sdm_grade_few(10, text), "");
    assert_string_equal(sdm_grade_few(0, text), "");
    for (int n = 9; n <= 10; n++) {
        sdm_verdict v = figures();
        v.heldout = n;
        trainer_verdict_decide(&in, &v);
        const bool told = strstr(v.sentence, " All figures come from 9 held-out shapes: raise "
                                             "data.holdout to 10 or more.");
        assert_int_equal(told, n == 9);
    }
}

// Where parts are inside out, the verdict names them as the cause, whichever part of the error is
// the largest, and no network is good: the maps lack these parts.
static void inside_out_is_the_cause(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500, .budget = 1000};
    for (int good = 0; good < 2; good++) {
        sdm_verdict v = figures();
        v.inside_out = 1;
        v.part_mm2[SDM_CAUSE_MAPS] = 8e-5;
        if (!good) v.dice = 0.5;
        trainer_verdict_decide(&in, &v);
        assert_non_null(strstr(v.sentence, "inside out"));
        assert_true(!v.limited && v.key[0] == 0 && v.grade != SDM_GRADE_GOOD);
        // open edges, too; the model file says it
        char unfit[SDM_MODEL_UNFIT];
        v = figures();
        v.open = 0.25;
        v.part_mm2[SDM_CAUSE_MAPS] = 8e-5;
        if (!good) v.dice = 0.5;
        trainer_verdict_decide(&in, &v);
        sdm_verdict_unfit(&v, unfit);
        assert_non_null(strstr(v.sentence, "open or badly oriented edges"));
        assert_non_null(strstr(unfit, "open or badly oriented edges of the meshes"));
        assert_true(!v.limited && v.key[0] == 0 && v.grade != SDM_GRADE_GOOD);
    }
}

// A model whose maps lack the thinnest part is not good, however small its error is.
static void parts_too_thin_for_the_grid(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500, .budget = 1000};
    for (int thick = 0; thick < 2; thick++) {
        sdm_verdict v = figures();
        v.coarse_mm = v.voxel_mm;
        v.thickness_mm = (thick ? 1.5 : 1.3) * v.voxel_mm;
        trainer_verdict_decide(&in, &v);
        assert_int_equal(v.grade, thick ? SDM_GRADE_GOOD : SDM_GRADE_USABLE);
    }
}

// A comparison that could not end names the other kind as the change: no key of this one beside it,
// which the command `next` does not change, but the grid of both.
static void unfinished_names_one_change(void **state)
{
    (void)state;
    sdm_verdict v = figures();
    v.limited = true, v.limit = SDM_CAUSE_NETWORK, v.at_best_mm = 0.03, v.minutes = 2;
    v.part_mm2[SDM_CAUSE_NETWORK] = 0.0027;
    strcpy(v.key, "network.depth");
    strcpy(v.sentence, "Polynomials alone limit the model: raise network.depth from 0 to 3.");
    trainer_verdict_unfinished("template", "pod", false, &v);
    assert_string_equal(v.sentence,
                        "network.kind: auto had no time left to train pod, too: pod may be better "
                        "than template, near the surface, too. Of its error 75 % is the further "
                        "error of the network on training maps.");
    assert_true(!v.key[0] && v.minutes == 0);
    strcpy(v.key, "grid.spacing");
    strcpy(v.sentence, "The grid limits the surface: lower grid.spacing from 2 to 1.");
    trainer_verdict_unfinished("template", "pod", false, &v);
    assert_non_null(strstr(v.sentence, "lower grid.spacing from 2 to 1."));
    assert_string_equal(v.key, "grid.spacing");
}

// A part that no grid shows: the shape is to be mended, no key to be changed.
static void hopelessly_thin_part(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500, .budget = 1000};
    sdm_verdict v = figures();
    v.coarse_mm = v.voxel_mm, v.thickness_mm = 0.004;
    v.part_mm2[SDM_CAUSE_BASES] = 8e-5;
    trainer_verdict_decide(&in, &v);
    assert_string_equal(v.key, "");
    assert_int_equal(v.grade, SDM_GRADE_POOR);
    assert_non_null(strstr(v.sentence,
                           "The thinnest part is 0.004 mm thick, 200 times thinner than "
                           "a voxel: no grid of the whole shape shows it. Is one of its "
                           "lengths in another unit than mm?"));
}

// The text of a grade leaves out what other figures exclude, says of a poor model that it is not
// for use, and why; and the verdict advises one spacing.
static void uses_and_spacing(void **state)
{
    (void)state;
    char text[SDM_GRADE_TEXT];
    sdm_verdict v = figures();
    v.coarse_mm = v.voxel_mm, v.thickness_mm = 5, v.volume_error = v.surface_volume_error = 0.01;
    assert_string_equal(sdm_grade_text(&v, text),
                        "for level sets, surfaces, measurements and fits to images with a blur "
                        "(standard deviation), or labels with voxels, of 0.67 mm or more");
    assert_true(isnan(sdm_verdict_spacing(&v)));
    char lines[SDM_MODEL_UNFIT];
    sdm_verdict_unfit(&v, lines);
    assert_string_equal(lines, "");
    // volumes that are off, edges that are cut, a part that is broken: no measurements
    v.volume_error = 0.03;
    assert_string_equal(
        sdm_grade_text(&v, text),
        "for level sets, surfaces and fits to images with a blur (standard deviation), or labels "
        "with voxels, of 0.67 mm or more");
    v.volume_error = 0.004, v.surface_volume_error = 0.029;
    assert_string_equal(
        sdm_grade_text(&v, text),
        "for level sets, surfaces and fits to images with a blur (standard deviation), or labels "
        "with voxels, of 0.67 mm or more");
    assert_true(fabs(sdm_verdict_spacing(&v) - 0.46) < 1e-9);
    sdm_verdict_unfit(&v, lines);
    assert_string_equal(lines, "volumes of surfaces (.stl): off by 2.9 %, voxels of 0.8 mm cut "
                               "edges and thin parts; about 1 % (root mean square of the shapes) "
                               "with generate --spacing 0.46\n");
    // one rule for the shapes of a training and for a single shape
    assert_true(sdm_spacing_for_volume(0.8, 0.029) == sdm_verdict_spacing(&v));
    // fits want more voxels across the thinnest part than surfaces do
    v.volume_error = v.surface_volume_error = 0.004, v.thickness_mm = 2.9 * v.coarse_mm;
    assert_string_equal(sdm_grade_text(&v, text), "for level sets, surfaces and measurements");
    sdm_verdict_unfit(&v, lines);
    assert_string_equal(lines, "fits by the network alone: the thinnest part, 2.3 mm in a few "
                               "held-out shapes, has 2.9 voxels across it, and 5 or more are safe; "
                               "use sdmgen fit --exact --spacing 0.46 (an image with a blur "
                               "below 0.38 mm: 1.2 times its blur)\n");
    // not 4 where there are nearly so many
    v.thickness_mm = 3.96 * v.coarse_mm;
    sdm_verdict_unfit(&v, lines);
    assert_non_null(strstr(lines, " has 3.9 voxels across it, "));
    // the promise holds for fits of all shapes: the check `map voxels` asks for four voxels across
    // the largest ball in one, and the fitted shape may be thinner
    v.thickness_mm = 4.9 * v.coarse_mm;
    assert_true(sdm_verdict_fit_spacing(&v) < 0.81 * v.thickness_mm / 4);
    assert_string_equal(sdm_grade_text(&v, text), "for level sets, surfaces and measurements");
    v.thickness_mm = 5.1 * v.coarse_mm;
    assert_true(isnan(sdm_verdict_fit_spacing(&v)));
    // and voxels of at most 0.8 times 1.5 times the blur: rounded up
    v.coarse_mm = 1.4, v.thickness_mm = 10;
    assert_non_null(strstr(sdm_grade_text(&v, text), " of 1.2 mm or more"));
    v.coarse_mm = 1.2;
    assert_non_null(strstr(sdm_grade_text(&v, text), " of 1 mm or more"));
    v.coarse_mm = 0.25;
    assert_non_null(strstr(sdm_grade_text(&v, text), " of 0.21 mm or more"));
    v.coarse_mm = 0.8;
    // none where no thickness is known
    v.thickness_mm = NAN;
    assert_string_equal(sdm_grade_text(&v, text), "for level sets, surfaces and measurements");
    sdm_verdict_unfit(&v, lines);
    assert_string_equal(lines, "");
    v.thickness_mm = 5, v.surface_volume_error = 0.029;
    // a finer grid does not help where the network errs
    v.volume_error = 0.025;
    assert_true(isnan(sdm_verdict_spacing(&v)));
    sdm_verdict_unfit(&v, lines);
    assert_string_equal(lines, "volumes of maps: off by 2.5 %\n"
                               "volumes of surfaces (.stl): off by 2.9 %\n");
    // nor does it where the key is the spacing for another reason
    strcpy(v.key, "grid.spacing"), v.to = 0.4;
    sdm_verdict_unfit(&v, lines);
    assert_non_null(strstr(lines, "volumes of surfaces (.stl): off by 2.9 %\n"));
    v.key[0] = '\0';
    // the lines of the uses
    v.volume_error = 0.123, v.thickness_mm = 1;
    strcpy(v.derivatives_bad, "r: off by 32 %");
    sdm_verdict_unfit(&v, lines);
    assert_string_equal(lines,
                        "volumes of maps: off by 12 %\n"
                        "its thinnest part and volumes of surfaces (.stl): it is 1 mm "
                        "thick in a few held-out shapes, too thin for voxels of 0.8 mm, "
                        "and will be missing or broken; grid.spacing 0.5 shows it\n"
                        "derivatives of maps by r: off by 32 %; the network causes it: sdmgen "
                        "exact --jacobian is exact\n");
    // what mends derivatives of the volume: what exact maps on the same voxels lack
    static const struct {
        const char *cause, *end;
    } causes[] = {
        {"", "by r: off by 50 %\n"},
        {"25 %: the voxels cause it",
         "by r: off by 50 %; exact maps on voxels of 0.8 mm err by 25 %: the voxels cause "
         "it; take differences of meshes\n"}};
    v.derivatives_bad[0] = '\0';
    strcpy(v.volume_derivatives_bad, "r: off by 50 %");
    for (size_t i = 0; i < sizeof causes / sizeof *causes; i++) {
        strcpy(v.volume_causes, causes[i].cause);
        sdm_verdict_unfit(&v, lines);
        const char *at = strstr(lines, "derivatives of the volume by ");
        if (!at || strcmp(at + strlen("derivatives of the volume "), causes[i].end))
            fail_msg("%s", lines);
    }
    v.volume_derivatives_bad[0] = '\0';
    v.volume_error = NAN;
    v.grade = SDM_GRADE_USABLE, v.thickness_mm = 1;
    assert_string_equal(sdm_grade_text(&v, text), "for pictures, segmentations and first fits");
    assert_true(fabs(sdm_verdict_spacing(&v) - 0.5) < 1e-9);
    // the key of the verdict comes first
    strcpy(v.key, "grid.spacing"), v.to = 0.4;
    assert_true(sdm_verdict_spacing(&v) == 0.4);
    // a poor model and its reason
    v.grade = SDM_GRADE_POOR;
    assert_string_equal(sdm_grade_text(&v, text),
                        "not for use: whole voxels are on the wrong side");
    v.thickness_mm = 0.5;
    assert_string_equal(sdm_grade_text(&v, text), "not for use: its thinnest part is missing");
    // no grid shows a part of a 200th of a voxel: there is none to advise
    v.thickness_mm = 0.004;
    sdm_verdict_unfit(&v, lines);
    assert_non_null(strstr(lines, "its thinnest part: it is 0.004 mm thick in a few held-out "
                                  "shapes, which no grid of the whole shape shows"));
    v.key[0] = '\0';
    assert_true(isnan(sdm_verdict_spacing(&v)));
    v.cut = 0.6;
    assert_non_null(strstr(sdm_grade_text(&v, text), "not for use: its grid cuts 60 % of"));
    v.inside_out = 1;
    assert_string_equal(sdm_grade_text(&v, text), "not for use: parts of the shape are missing");
}

/* Tetrahedra: one, or from half of the range of the second parameter on two. */
static int pair_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    static const uint32_t TRI[12] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    const size_t n = p[1] < 0.5 ? 1 : 2;
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 4 * n, 4 * n);
    for (size_t i = 0; i < n && !failed; i++)
        for (uint32_t k = 0; k < 12; k++) {
            out->vert[12 * i + k] = (k % 3 + 1 == k / 3 ? p[0] : 0) + (double)(3 * i);
            out->tri[12 * i + k] = TRI[k] + 4 * (uint32_t)i;
        }
    return failed;
}

// The parameter that changes the triangles is found, and no other one.
static void triangles_change(void **state)
{
    (void)state;
    static const sdm_param PARAMS[] = {{"size", "mm", 1, 2, 1, ""}, {"many", "", 0, 1, 0, ""}};
    static const sdm_shape SHAPE = {.abi = SDM_SHAPE_ABI,
                                    .size = sizeof(sdm_shape),
                                    .name = "tetrahedra",
                                    .summary = "one or two tetrahedra",
                                    .params = PARAMS,
                                    .n_params = 2,
                                    .mesh = pair_mesh};
    double p[2] = {1, 0};
    size_t param;
    sdm_error e = {0};
    sdm_instance *shape = NULL;
    if (sdm_instance_create(&SHAPE, NULL, 0, NULL, &shape, &e)) fail_msg("%s", e.text);
    dataset d = {.shape = shape,
                 .n_params = 2,
                 .min = {1, 0},
                 .max = {2, 1},
                 .n_holdout = 1,
                 .holdout_params = p};
    assert_int_equal(trainer_find_triangles_param(&d, &param, &e), SDM_OK);
    assert_int_equal(param, 1);
    d.max[1] = 0.4; // within this range nothing changes
    assert_int_equal(trainer_find_triangles_param(&d, &param, &e), SDM_OK);
    assert_int_equal(param, 2);
    sdm_instance_free(shape);
}

// Shapes that leave the grid come first in the sentence; what limits the others follows.
static void grid_cuts(void **state)
{
    (void)state;
    const sdm_config c = config_of(NULL, 0);
    const verdict_input in = {.config = &c, .maps = 200, .steps = 1500};
    sdm_verdict v = figures();
    v.part_mm2[SDM_CAUSE_BASES] = 1e-4;
    v.cut = 0.123;
    trainer_verdict_decide(&in, &v);
    assert_true(strstr(v.sentence, "cuts 12 % of the shapes") && strstr(v.sentence, "grid: auto"));
    assert_true(strstr(v.sentence, "raise network.rank from 8 to 16"));
    v.cut = 1;
    trainer_verdict_decide(&in, &v);
    assert_non_null(strstr(v.sentence, "cuts all shapes"));
    assert_int_equal(v.grade, SDM_GRADE_POOR);
}

// Errors of 4, 3 and 2 mm at the steps 0, 60 and 90: a third of 3 mm in the last third of the
// steps.
static void error_falls_in_the_last_third(void **state)
{
    (void)state;
    sdm_text metrics = {0};
    trainer t = {.metrics = &metrics};
    history h;
    sdm_text_add(&metrics, "{\"phase\": \"auto\", \"kind\": \"pod\", \"pod_rmse_mm\": 1}\n");
    for (int i = 0; i < 3; i++)
        sdm_text_add(
            &metrics,
            "{\"phase\": \"fit\", \"step\": %d, \"loss_mm2\": %s, \"heldout_mse_mm2\": %d}\n",
            i == 2 ? 90 : 60 * i, i ? "0.5" : "null", (4 - i) * (4 - i));
    sdm_text_add(&metrics, "{\"phase\": \"evaluate\", \"step\": 90, \"loss_mm2\": null, "
                           "\"heldout_mse_mm2\": 9}\n{\"phase\": \"verdict\", \"rmse_mm\": 3}\n");
    assert_int_equal(trainer_history_read(&t, &h, NULL), SDM_OK);
    assert_int_equal(h.n, 4);
    assert_int_equal(trainer_history_last_step(&h), 90);
    assert_true(isnan(h.point[0].loss) && h.point[1].loss == 0.5 && h.point[3].heldout == 9);
    assert_true(fabs(trainer_history_fall(&h, SDM_PHASE_MODE_FIT, 0) - 1 / 3.0) < 1e-12);
    // beyond a floor of 4 mm^2 nothing is left
    assert_true(fabs(trainer_history_fall(&h, SDM_PHASE_MODE_FIT, 4) - 1) < 1e-12);
    assert_true(isnan(trainer_history_fall(&h, SDM_PHASE_REFINE, 0)));
    trainer_history_dispose(&h);
    sdm_text_dispose(&metrics);
}

// Evaluations: fixed steps with a budget of steps; with a budget of time, intervals that double.
static void evaluations_are_due(void **state)
{
    (void)state;
    static const int64_t steps[] = {10, 20, 50, 100, 200, 500, 1000, 1500};
    sdm_config c = config_of(NULL, 0);
    trainer t = {.config = &c};
    size_t n = 0;
    for (t.phase_step = 1; t.phase_step <= 1500; t.phase_step++) {
        if (!trainer_evaluation_due(&t, 0)) continue;
        assert_true(n < 8 && t.phase_step == steps[n]);
        assert_int_equal(trainer_evaluation_counts(&t), n >= 5);
        n++;
    }
    assert_int_equal(n, 8);
    c.train.minutes = 3, c.train.steps = 0, c.train.evaluate_seconds = 20;
    double last = 0, longest = 0;
    n = 0;
    for (double now = 0; now < 180; now += 0.05) {
        if (!trainer_evaluation_due(&t, now)) continue;
        assert_true(trainer_evaluation_counts(&t));
        longest = fmax(longest, now - last);
        t.last_evaluation = last = now;
        n++;
    }
    assert_true(n >= 10 && n <= 14 && longest <= 20.1);
    // an evaluation of half a second comes every ten seconds at most
    t.last_evaluation = 100, t.phase_started = 99, t.evaluation_seconds = 0.5;
    assert_false(trainer_evaluation_due(&t, 109.9));
    assert_true(trainer_evaluation_due(&t, 110.1));
}

// The parts add up to the mean square error, for whatever is refined and however weights are
// stored.
static void parts_add_up(void **state)
{
    (void)state;
    static const char *const sets[][3] = {
        {"train.refine=0", "train.steps=300", "network.weights=i8"},
        {"train.refine=0.5", "train.steps=400", "network.weights=f32"},
        {"train.refine=0", "network.depth=0", "network.weights=f16"}};
    for (size_t i = 0; i < 3; i++) {
        const sdm_train_report r = train(sets[i], 3);
        const double *part = r.verdict.part_mm2;
        double sum = 0;
        for (int k = 0; k <= SDM_CAUSE_ROUNDING; k++) sum += part[k];
        assert_true(fabs(sum - r.accuracy.mse_mm2) < 1e-9 * r.accuracy.mse_mm2);
        assert_true(part[SDM_CAUSE_BASES] > 0 && part[SDM_CAUSE_NETWORK] >= 0);
        assert_true(isnan(part[SDM_CAUSE_TEMPLATE]) && part[SDM_CAUSE_GRID] > 0);
        // floats are not rounded
        if (i == 1) assert_true(fabs(part[SDM_CAUSE_ROUNDING]) < 1e-3 * r.accuracy.mse_mm2);
    }
}

// Each limit is provoked, named, and the advice followed: the error becomes smaller.
static void advice_helps(void **state)
{
    (void)state;
    static const struct {
        sdm_cause limit;
        const char *key, *set[4];
    } cases[] = {
        {SDM_CAUSE_BASES, "network.rank", {"network.rank=1"}},
        {SDM_CAUSE_MAPS, "data.start", {"data.start=16"}},
        {SDM_CAUSE_NETWORK,
         "network.width",
         {"network.width=8", "network.depth=1", "network.degree=1", "train.steps=2500"}},
        {SDM_CAUSE_NETWORK, "network.depth", {"network.depth=0", "network.degree=1"}},
        {SDM_CAUSE_NETWORK, "train.steps", {"train.steps=60", "network.degree=1"}},
        {SDM_CAUSE_GRID, "grid.spacing", {"grid.spacing=2.4", "grid.size=[7,6,6]"}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *set[6] = {NULL};
        size_t n = 0;
        while (n < 4 && cases[i].set[n]) set[n] = cases[i].set[n], n++;
        const sdm_train_report before = train(set, n);
        if (before.verdict.limit != cases[i].limit || strcmp(before.verdict.key, cases[i].key))
            fail_msg("%s: %s", cases[i].set[0], before.verdict.sentence);
        char change[64];
        snprintf(change, sizeof change, "%s=%.9g", before.verdict.key, before.verdict.to);
        set[n++] = change;
        if (cases[i].limit == SDM_CAUSE_GRID) set[n++] = "grid.size=[14,12,12]";
        const sdm_train_report after = train(set, n);
        const bool grid = cases[i].limit == SDM_CAUSE_GRID;
        const double was = grid ? before.verdict.part_mm2[SDM_CAUSE_GRID] : before.accuracy.mse_mm2,
                     is = grid ? after.verdict.part_mm2[SDM_CAUSE_GRID] : after.accuracy.mse_mm2;
        if (!(is < 0.8 * was)) fail_msg("%s: %g, then %g", change, was, is);
    }
}

typedef struct seen {
    int reports, rates;
    double heldout_first; // step of the first held-out error
} seen;

static void look(void *user, const sdm_progress *p)
{
    seen *s = user;
    s->reports++;
    // a rate is unknown or positive, never 0; a held-out error has its time
    assert_true(isnan(p->samples_per_second) || p->samples_per_second > 0);
    assert_true(isnan(p->heldout_rmse_mm) == isnan(p->heldout_seconds));
    assert_true(!(p->heldout_seconds > p->seconds));
    assert_true(p->samples >= 0 &&
                (p->phase != SDM_PHASE_DATA || p->samples <= p->samples_at_start));
    s->rates += p->samples_per_second > 0;
    if (isnan(s->heldout_first) && p->heldout_rmse_mm > 0) s->heldout_first = (double)p->step;
}

static void progress_is_true(void **state)
{
    (void)state;
    seen s = {.heldout_first = NAN};
    const sdm_train_hooks hooks = {.progress = look, .user = &s};
    const sdm_config c = config_of(NULL, 0);
    sdm_error e = {0};
    run_files_remove();
    if (sdm_train(&c, capsule, folder, false, &hooks, NULL, &e)) fail_msg("%s", e.text);
    assert_true(s.reports > 3 && s.rates > 1 && s.heldout_first <= 1000);
}

/* With any argument: the tests that take long. */
int main(int argc, char **argv)
{
    (void)argv;
    const struct CMUnitTest slow[] = {cmocka_unit_test(advice_helps)};
    if (argc > 1) return cmocka_run_group_tests(slow, set_up, tear_down);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(largest_part_limits),
        cmocka_unit_test(length_of_the_training),
        cmocka_unit_test(minutes_hold_the_maps),
        cmocka_unit_test(patience_left_time),
        cmocka_unit_test(static_grid_took_the_time),
        cmocka_unit_test(error_far_from_the_surface),
        cmocka_unit_test(template_errs_near_the_surface),
        cmocka_unit_test(grid_limits),
        cmocka_unit_test(grades),
        cmocka_unit_test(few_heldout_shapes),
        cmocka_unit_test(hopelessly_thin_part),
        cmocka_unit_test(uses_and_spacing),
        cmocka_unit_test(unfinished_names_one_change),
        cmocka_unit_test(triangles_change),
        cmocka_unit_test(grid_cuts),
        cmocka_unit_test(inside_out_is_the_cause),
        cmocka_unit_test(parts_too_thin_for_the_grid),
        cmocka_unit_test(error_falls_in_the_last_third),
        cmocka_unit_test(evaluations_are_due),
        cmocka_unit_test(parts_add_up),
        cmocka_unit_test(progress_is_true),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
