/* Configuration of an experiment: rows, variants, the training configuration of each row,
 * references to published figures, and every mistake with its position.
 * Tests: experiment.c experiment_rows.c experiment_schema.c overrides.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/experiment.h"
#include "sdm/internal/heap.h"

#define SHAPE "shape: {name: ball}\ngrid: {size: [4, 5, 6], spacing: 1}\ntrain: {steps: 10}\n"
#define METHODS "methods:\n  - {name: A, network: pod}\n  - {name: B, engine: exact}\n"

static sdm_experiment *e;
static sdm_config config;
static sdm_error err;

static sdm_status parse(const char *text, const char *const *overrides, size_t n)
{
    memset(&err, 0, sizeof err);
    sdm_experiment_free(e);
    return sdm_experiment_parse("dir/x.yaml", text, strlen(text), overrides, n, &e, &err);
}

static void expect_ok(const char *text, const char *override)
{
    if (parse(text, &override, override != NULL))
        fail_msg("%s: %s", override ? override : text, err.text);
}

static void expect_mistake(const char *text, const char *override, const char *message)
{
    assert_int_equal(parse(text, &override, override != NULL), SDM_E_CONFIG);
    assert_null(e);
    assert_string_equal(err.text, message);
}

static int free_last(void **state)
{
    (void)state;
    sdm_experiment_free(e);
    e = NULL;
    return 0;
}

static void test_defaults(void **state)
{
    (void)state;
    expect_ok(SHAPE METHODS, NULL);
    assert_string_equal(e->experiment.title, "x");
    assert_string_equal(e->experiment.folder, "runs/x");
    assert_int_equal(e->experiment.seed, 1);
    assert_int_equal(e->experiment.samples, 100);
    assert_int_equal(e->experiment.engine_samples, 5);
    assert_true(e->experiment.minutes == 0);
    assert_string_equal(e->experiment.baseline, "");
    assert_string_equal(e->experiment.reference, "reference");
    assert_int_equal(e->experiment.pictures, 1);
    assert_int_equal(e->n_rows, 2);
    assert_string_equal(e->rows[0].title, "A");
    assert_string_equal(e->rows[0].folder, "a");
    assert_int_equal(e->rows[0].samples, 100);
    assert_int_equal(e->rows[1].samples, 5);
    assert_null(e->rows[0].variant);
    assert_null(e->rows[0].reference);
}

/* Precedence, lowest first: the experiment's own keys, the method's, the variant's, the command
 * line's. */
static void test_order_of_keys(void **state)
{
    const char *text = "shape: {name: ball, options: {edge: 0.5, file: 'a, b'}}\ngrid: {size: [4, "
                       "5, 6], spacing: 1}\n"
                       "train: {steps: 10, batch: 3}\nseed: 5\n"
                       "methods:\n"
                       "  - {name: A, network: pod, set: {train: {batch: 4}, train.near_mm: 0.2, "
                       "data.static: [2, 3]}}\n"
                       "  - {name: B, network: pod, samples: 7}\n"
                       "variants:\n"
                       "  - {name: fine, set: {grid.spacing: 0.5, train.near_mm: 0.3}}\n"
                       "  - {name: 'long', set: {train.minutes: 2}}\n";
    (void)state;
    expect_ok(text, NULL);
    assert_int_equal(e->n_rows, 4);
    static const char *const titles[] = {"A, fine", "B, fine", "A, long", "B, long"};
    for (size_t i = 0; i < 4; i++) assert_string_equal(e->rows[i].title, titles[i]);
    assert_string_equal(e->rows[0].folder, "a-fine");
    assert_int_equal(e->rows[1].samples, 7);
    assert_int_equal(sdm_experiment_config(e, 0, &config, &err), SDM_OK);
    assert_int_equal(config.train.batch, 4);
    assert_true(config.train.near_mm == 0.3);
    assert_true(config.grid.spacing[1] == 0.5);
    assert_int_equal(config.train.steps, 10);
    assert_int_equal(config.seed, 5);
    assert_int_equal(config.data.n_static_counts, 2);
    assert_int_equal(config.data.static_counts[1], 3);
    assert_string_equal(config.shape.options[0].value, "0.5");
    assert_string_equal(config.shape.options[1].value, "a, b");
    assert_int_equal(sdm_experiment_config(e, 3, &config, &err), SDM_OK);
    assert_int_equal(config.train.batch, 3);
    assert_true(config.grid.spacing[1] == 1);
    assert_true(config.train.minutes == 2 && config.train.steps == 0);
    assert_int_equal(sdm_experiment_config(e, 4, &config, &err), SDM_E_ARG);

    const char *overrides[] = {"train.batch=9", "experiment.samples=3", "seed=6"};
    assert_int_equal(parse(text, overrides, 3), SDM_OK);
    assert_int_equal(e->rows[0].samples, 3);
    assert_int_equal(e->rows[1].samples, 7);
    assert_int_equal(sdm_experiment_config(e, 0, &config, &err), SDM_OK);
    assert_int_equal(config.train.batch, 9);
    assert_int_equal(config.seed, 6);
}

/* A row without training needs no training budget, but may have one. */
static void test_engines_need_no_budget(void **state)
{
    (void)state;
    expect_ok("shape: {name: ball}\ngrid: {size: [4, 5, 6], spacing: 1}\nmethods: [{name: B, "
              "engine: exact}]\n",
              NULL);
    expect_mistake("shape: {name: ball}\ngrid: {size: [4, 5, 6], spacing: 1}\nmethods: [{name: B, "
                   "network: pod}]\n",
                   NULL,
                   "dir/x.yaml:1:1: missing key: one of train.minutes, train.steps and "
                   "train.samples must be positive");
}

static void test_references_are_read(void **state)
{
    const char *text =
        SHAPE METHODS "reference:\n  - {row: B, ms: 200, mse_mm2: 6e-3, source: 'table 1'}\n";
    (void)state;
    expect_ok(text, NULL);
    assert_null(e->rows[0].reference);
    assert_non_null(e->rows[1].reference);
    assert_true(e->rows[1].reference->value[SDM_FIGURE_MS] == 200);
    assert_true(e->rows[1].reference->value[SDM_FIGURE_MSE] == 6e-3);
    assert_true(isnan(e->rows[1].reference->value[SDM_FIGURE_RMSE]));
    assert_string_equal(e->rows[1].reference->source, "table 1");
    expect_mistake(SHAPE METHODS "reference: [{row: Elephant, ms: 1}]\n", NULL,
                   "dir/x.yaml:7:13: reference: there is no row 'Elephant'");
    expect_mistake(SHAPE METHODS "reference: [{row: B}, {row: B}]\n", NULL,
                   "dir/x.yaml:7:23: reference: a second one for the row 'B' (first at line 7)");
    expect_mistake(SHAPE METHODS "reference: [{row: B, mse: 1}]\n", NULL,
                   "dir/x.yaml:7:22: unknown key 'mse'; did you mean 'ms'?");
    expect_mistake(SHAPE METHODS "reference: [{row: B, ms: -1}]\n", NULL,
                   "dir/x.yaml:7:26: ms: -1 is out of range (0 .. 1000000000000)");
    expect_mistake(SHAPE METHODS "reference: [{ms: 1}]\n", NULL,
                   "dir/x.yaml:7:13: reference: missing key 'row'");
}

/* Methods with `fit`: values of their keys, and which network a `polish` row uses, in each
 * variant. */
static void test_fit_rows(void **state)
{
    const char *text = SHAPE "fit: {phantoms: 3, off_deg: 5}\nmethods:\n"
                             "  - {name: N, network: pod, fit: network, set: {train.batch: 4}}\n"
                             "  - {name: P, fit: polish}\n"
                             "  - {name: X, fit: exact}\n"
                             "  - {name: M, network: deepsdf, fit: network}\n"
                             "  - {name: Q, fit: polish}\n"
                             "  - {name: V, fit: naive}\n"
                             "variants: [{name: a, set: {}}, {name: b, set: {seed: 9}}]\n"
                             "reference: [{row: 'X, a', difference: {a: 2e-8, phi: 0}}]\n";
    (void)state;
    expect_ok(text, NULL);
    assert_int_equal(e->fit.phantoms, 3);
    assert_true(e->fit.off_mm == 1 && e->fit.off_deg == 5 && e->fit.voxel == 0.25 &&
                e->fit.range == 0.8);
    assert_true(e->fit.prior_sd == 1 && e->fit.eps == 3e-6);
    assert_string_equal(e->fit.model, "");
    static const size_t networks[] = {0, 0, 2, 3, 3, 5, 6, 6, 8, 9, 9, 11};
    for (size_t i = 0; i < 12; i++) assert_int_equal(e->rows[i].network_row, networks[i]);
    assert_string_equal(e->rows[2].method->engine, "exact");
    assert_string_equal(e->rows[5].method->engine, "naive");
    assert_string_equal(e->rows[4].method->network, "deepsdf");
    assert_int_equal(sdm_experiment_config(e, 7, &config, &err), SDM_OK);
    assert_int_equal(config.train.batch, 4);
    assert_int_equal(config.seed, 9);
    const sdm_experiment_reference *r = e->rows[2].reference;
    assert_int_equal(r->n_differences, 2);
    assert_string_equal(r->differences[1].name, "phi");
    assert_true(r->differences[0].value == 2e-8 && r->differences[1].value == 0);
    expect_ok(SHAPE METHODS, NULL);
    assert_int_equal(e->fit.phantoms, 9);
    assert_int_equal(e->rows[1].network_row, 1);
}

/* fit.model is relative to the folder of the file; on the command line it is relative to the
 * working folder. */
static void test_path_of_fit_model(void **state)
{
    const char *text =
        SHAPE "fit: {model: m.sdm}\nmethods: [{name: N, network: pod, fit: network}]\n";
    (void)state;
    expect_ok(text, NULL);
    assert_string_equal(e->fit.model, "dir/m.sdm");
    expect_ok(text, "fit.model=n.sdm");
    assert_string_equal(e->fit.model, "n.sdm");
    expect_ok(SHAPE "fit: {model: /m.sdm}\nmethods: [{name: N, network: pod, fit: network}]\n",
              NULL);
    assert_string_equal(e->fit.model, "/m.sdm");
}

static void test_mistakes_of_fits(void **state)
{
    (void)state;
    expect_mistake(
        SHAPE "methods: [{name: A, fit: polish}, {name: B, network: pod, fit: network}]\n", NULL,
        "dir/x.yaml:4:11: method 'A' with fit: polish needs one with fit: network before it");
    expect_mistake(
        SHAPE "methods: [{name: A, network: pod, fit: exact}]\n", NULL,
        "dir/x.yaml:4:11: method 'A' with this fit needs none of the keys network and engine");
    expect_mistake(SHAPE METHODS, "fit.model=m.sdm",
                   "argument 'fit.model=m.sdm': fit.model: one model for 0 methods with fit: "
                   "network, need one such "
                   "method");
    expect_mistake(SHAPE METHODS "reference: [{row: B, difference: 3}]\n", NULL,
                   "dir/x.yaml:7:34: difference: needs numbers by names of parameters, got '3'");
    expect_mistake(SHAPE METHODS "reference: [{row: B, difference: {a: -1}}]\n", NULL,
                   "dir/x.yaml:7:38: difference: -1 is out of range (0 .. 1000000000000)");
}

/* Each column of the result table can have a reference value, under the key that it has in the
 * results. */
static void test_figures_have_keys(void **state)
{
    char text[600];
    (void)state;
    for (int f = 0; f < SDM_N_FIGURES; f++) {
        const sdm_figure_info *info = sdm_figure_get_info((sdm_figure)f);
        assert_true(info->key && info->title && info->unit && info->help);
        snprintf(text, sizeof text, SHAPE METHODS "reference: [{row: A, %s: 0.5}]\n", info->key);
        expect_ok(text, NULL);
        assert_true(e->rows[0].reference->value[f] == 0.5);
    }
    assert_null(sdm_figure_get_info(SDM_N_FIGURES));
}

static void test_mistakes_of_the_experiment(void **state)
{
    (void)state;
    expect_mistake(SHAPE "experiment: {sampels: 5}\n" METHODS, NULL,
                   "dir/x.yaml:4:14: unknown key 'experiment.sampels'; did you mean 'samples'?");
    expect_mistake(SHAPE METHODS, "experiment.sampels=5",
                   "argument 'experiment.sampels=5': unknown key 'experiment.sampels'; did you "
                   "mean 'experiment.samples'?");
    expect_mistake(
        SHAPE METHODS, "experiment.samples=0",
        "argument 'experiment.samples=0': experiment.samples: 0 is out of range (1 .. 1000000)");
    expect_mistake(SHAPE METHODS, "methods=[]",
                   "argument 'methods=[]': methods: a list of the file cannot be replaced here");
    expect_mistake(SHAPE METHODS, "pictures", "argument 'pictures': not of the form key=value");
    expect_mistake(SHAPE METHODS "method: 3\n", NULL,
                   "dir/x.yaml:7:1: unknown key 'method'; did you mean 'methods'?");
    expect_mistake(SHAPE, NULL,
                   "dir/x.yaml:1:1: missing key 'methods': a list of at least one, e.g. - {name: "
                   "POD, network: pod}");
    expect_mistake(SHAPE "methods: []\n", NULL,
                   "dir/x.yaml:4:1: missing key 'methods': a list of at least one, e.g. - {name: "
                   "POD, network: pod}");
    expect_mistake(SHAPE "methods: 3\n", NULL,
                   "dir/x.yaml:4:10: methods: needs a list of at most 64, got '3'");
    expect_mistake(SHAPE "methods: [3]\n", NULL,
                   "dir/x.yaml:4:11: the configuration: needs keys with values, got '3'");
    expect_mistake(SHAPE "methods: [{engine: exact}]\n", NULL,
                   "dir/x.yaml:4:11: methods: missing key 'name'");
    expect_mistake(SHAPE "methods: [{name: A}]\n", NULL,
                   "dir/x.yaml:4:11: method 'A' needs one of the keys network and engine");
    expect_mistake(SHAPE "methods: [{name: A, engine: exact, network: pod}]\n", NULL,
                   "dir/x.yaml:4:11: method 'A' needs only one of the keys network and engine");
    expect_mistake(SHAPE "methods: [{name: A, engnie: exact}]\n", NULL,
                   "dir/x.yaml:4:21: unknown key 'engnie'; did you mean 'engine'?");
    expect_mistake(
        SHAPE "methods: [{name: A b, engine: exact}, {name: a-b, engine: naive}]\n", NULL,
        "dir/x.yaml:4:39: the names 'A b' and 'a-b' give the same folder 'a-b'; change one");
    expect_mistake(
        SHAPE "experiment: {baseline: Bb}\n" METHODS, NULL,
        "dir/x.yaml:4:14: experiment.baseline: there is no method 'Bb'; did you mean 'B'?");
    expect_mistake(SHAPE METHODS "variants: [{name: a, set: 3}]\n", NULL,
                   "dir/x.yaml:7:27: set: needs keys with values, got '3'");
    expect_mistake(SHAPE METHODS "output: {folder: x}\n", NULL,
                   "dir/x.yaml:7:1: unknown key 'output'; the keys are base, shape, grid, network, "
                   "data, train, seed, threads, methods, variants, reference, experiment, fit");
}

/* Variants with the same training share the network of the first of them. */
static void test_networks_of_variants(void **state)
{
    (void)state;
    expect_ok(SHAPE "methods: [{name: A, network: pod}, {name: B, engine: exact}]\n"
                    "variants: [{name: a}, {name: b, finer: 3}, {name: c, set: {seed: 9}},\n"
                    "  {name: d, finer: 2, set: {seed: 9}}, {name: e, finer: 3, set: {seed: 8}}]\n",
              NULL);
    static const size_t networks[] = {0, 1, 0, 1, 4, 5, 4, 5, 8, 9};
    static const int64_t finer[] = {1, 3, 1, 2, 3};
    for (size_t i = 0; i < 10; i++) assert_int_equal(e->rows[i].network_row, networks[i]);
    for (size_t i = 0; i < 5; i++) assert_int_equal(e->variants[i].finer, finer[i]);
}

/* A mistake in a training key of a row is reported at the key, not at the start of the row. */
static void test_mistakes_of_the_training(void **state)
{
    (void)state;
    expect_mistake(SHAPE "methods:\n  - name: A\n    network: pod\n    set: {network.dpth: 4}\n",
                   NULL,
                   "dir/x.yaml:7:11: unknown key 'network.dpth'; did you mean 'network.depth'?");
    expect_mistake(
        SHAPE
        "methods:\n  - name: A\n    network: pod\n    set:\n      train:\n        batch: many\n",
        NULL, "dir/x.yaml:9:9: train.batch: needs an integer, got 'many'");
    expect_mistake(
        "shape: {name: ball}\ngrid: {size: [4, 5], spacing: 1}\ntrain: {steps: 10}\n" METHODS, NULL,
        "dir/x.yaml:2:8: grid.size: needs three integers [x, y, z], got a list of 2");
    expect_mistake(SHAPE METHODS "variants: [{name: a, set: {grid.spacing: -1}}]\n", NULL,
                   "dir/x.yaml:7:28: grid.spacing: -1 is out of range (1e-06 .. 1000000)");
    expect_mistake(SHAPE METHODS, "train.batch=x",
                   "argument 'train.batch=x': train.batch: needs an integer, got 'x'");
    expect_mistake(SHAPE "methods: [{name: A, network: pod, set: {'train.batch=3': 4}}]\n", NULL,
                   "dir/x.yaml:4:41: 'train.batch=3' is no key of a training configuration");
    expect_mistake(SHAPE "methods: [{name: A, network: pod, set: {train.batch: '4'}}]\n", NULL,
                   "dir/x.yaml:4:41: train.batch: needs an integer, got the text '4'");
    assert_int_equal(parse(SHAPE "methods: [{name: A, network: pood}]\n", NULL, 0), SDM_E_CONFIG);
    assert_memory_equal(err.text, "dir/x.yaml:4:11: network.kind: 'pood' is not one of pod", 52);
}

static void test_base_file_is_merged(void **state)
{
    FILE *f = fopen("test_experiment_base.yaml", "w");
    (void)state;
    assert_non_null(f);
    fputs(SHAPE "seed: 3\n", f);
    fclose(f);
    memset(&err, 0, sizeof err);
    sdm_experiment_free(e);
    const char *text = "base: test_experiment_base.yaml\n" METHODS "train: {batch: 5}\n";
    assert_int_equal(sdm_experiment_parse("./x.yaml", text, strlen(text), NULL, 0, &e, &err),
                     SDM_OK);
    assert_string_equal(e->base, "./test_experiment_base.yaml");
    assert_int_equal(sdm_experiment_config(e, 0, &config, &err), SDM_OK);
    assert_int_equal(config.seed, 3);
    assert_int_equal(config.train.batch, 5);
    assert_string_equal(config.file, "./test_experiment_base.yaml");
    remove("test_experiment_base.yaml");

    expect_mistake("base: ../x.yaml\n" METHODS, NULL,
                   "dir/x.yaml:1:1: base: '../x.yaml' must be the name of a file beside this one");
    expect_mistake("base: ..\n" METHODS, NULL,
                   "dir/x.yaml:1:1: base: '..' must be the name of a file beside this one");
    assert_int_equal(parse("base: missing.yaml\n" METHODS, NULL, 0), SDM_E_CONFIG);
    assert_memory_equal(err.text, "dir/x.yaml:1:1: base: ", 22);
    assert_non_null(strstr(err.text, "missing.yaml"));
}

static void test_shipped_files(void **state)
{
    static const char *const files[] = {"paper", "grids", "paper-fit"};
    (void)state;
    for (size_t i = 0; i < 3; i++) {
        char path[1024];
        snprintf(path, sizeof path, SDM_SOURCE_FOLDER "/configs/%s.yaml", files[i]);
        sdm_experiment_free(e);
        if (sdm_experiment_read(path, NULL, 0, &e, &err)) fail_msg("%s", err.text);
        assert_true(e->n_rows >= 4);
    }
}

/* Each allocation fails once: an error, and no leak (detected by the sanitizer build). */
static void test_each_allocation_may_fail(void **state)
{
    sdm_status s = SDM_E_NOMEM;
    (void)state;
    sdm_experiment_free(e);
    e = NULL;
    for (unsigned long n = 1; s && n < 200; n++) {
        const char *text = SHAPE METHODS
            "variants: [{name: a, set: {grid.spacing: 2}}]\nreference: [{row: 'A, a', ms: 1}]\n";
        sdm_alloc_fail_after(n);
        s = sdm_experiment_parse("x.yaml", text, strlen(text), NULL, 0, &e, &err);
        sdm_alloc_fail_after(0);
        if (s) assert_null(e);
        // never a list of mistakes, which would be the user's
        if (s) assert_int_equal(s, SDM_E_NOMEM);
    }
    assert_int_equal(s, SDM_OK);
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_experiment *out = NULL;
    assert_int_equal(sdm_experiment_parse(NULL, "", 0, NULL, 0, &out, &err), SDM_E_ARG);
    assert_int_equal(sdm_experiment_parse("x", NULL, 3, NULL, 0, &out, &err), SDM_E_ARG);
    assert_int_equal(sdm_experiment_parse("x", "", 0, NULL, 1, &out, &err), SDM_E_ARG);
    assert_int_equal(sdm_experiment_parse("x", "", 0, NULL, 0, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_experiment_read(NULL, NULL, 0, &out, &err), SDM_E_ARG);
    assert_int_equal(sdm_experiment_read("does/not/exist.yaml", NULL, 0, &out, &err), SDM_E_IO);
    assert_int_equal(sdm_experiment_config(NULL, 0, &config, &err), SDM_E_ARG);
    assert_int_equal(parse("", NULL, 0), SDM_E_CONFIG);
    assert_int_equal(parse("[1, 2]", NULL, 0), SDM_E_CONFIG);
    assert_int_equal(parse("a: [", NULL, 0), SDM_E_CONFIG);
    sdm_experiment_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_order_of_keys),
        cmocka_unit_test(test_engines_need_no_budget),
        cmocka_unit_test(test_references_are_read),
        cmocka_unit_test(test_fit_rows),
        cmocka_unit_test(test_path_of_fit_model),
        cmocka_unit_test(test_mistakes_of_fits),
        cmocka_unit_test(test_figures_have_keys),
        cmocka_unit_test(test_mistakes_of_the_experiment),
        cmocka_unit_test(test_networks_of_variants),
        cmocka_unit_test(test_mistakes_of_the_training),
        cmocka_unit_test(test_base_file_is_merged),
        cmocka_unit_test(test_shipped_files),
        cmocka_unit_test(test_each_allocation_may_fail),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, free_last);
}
