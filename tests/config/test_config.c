/* Configuration: values, defaults, overrides, rules between keys, and the exact wording of the
 * messages about mistakes.
 * Tests: config.c fields.c grid_keys.c kinds.c mistakes.c schema.c special.c
 * yaml_tree.c */
#include <locale.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "config_tools.h"
#include "sdm/internal/heap.h"

static void test_defaults(void **state)
{
    (void)state;
    expect_ok(BASE, NULL);
    assert_string_equal(config.file, "x.yaml");
    assert_string_equal(config.shape.name, "ball");
    assert_int_equal(config.shape.mark.line, 1);
    assert_int_equal(config.shape.mark.column, 9);
    assert_int_equal(config.shape.n_options, 0);
    assert_int_equal(config.shape.n_ranges, 0);
    assert_int_equal(config.network.kind, SDM_NETWORK_AUTO);
    assert_int_equal(config.network.depth, 3);
    assert_int_equal(config.network.width, 128);
    assert_int_equal(config.network.rank, 9);
    assert_int_equal(config.network.block, 4);
    assert_int_equal(config.network.levels, 3);
    assert_int_equal(config.network.modes, 512);
    assert_int_equal(config.network.degree, 6);
    assert_int_equal(config.network.input_degree, 4);
    assert_int_equal(config.network.activation, SDM_ACTIVATION_SILU);
    assert_int_equal(config.network.weights, SDM_WEIGHT_I8);
    assert_int_equal(config.data.n_static_counts, 1);
    assert_int_equal(config.data.static_counts[0], SDM_STATIC_AUTO);
    static const int64_t by_params[] = {0, 5, 5, 5, 4, 3, 3, 2, 2, 2, 0, 0};
    for (size_t n = 1; n < sizeof by_params / sizeof *by_params; n++)
        assert_int_equal(sdm_config_static_count(&config, n, n - 1), by_params[n]);
    assert_int_equal(sdm_config_static_count(&config, SDM_MAX_PARAMS, 0), 0);
    // with a budget of time at most 300 maps for each minute of it
    const double budget = config.train.minutes;
    config.train.minutes = 1;
    static const int64_t of_a_minute[] = {0, 5, 5, 5, 4, 3, 3, 2, 2, 0};
    for (size_t n = 1; n < sizeof of_a_minute / sizeof *of_a_minute; n++)
        assert_int_equal(sdm_config_static_count(&config, n, 0), of_a_minute[n]);
    // ... and more minutes do not make a grid of three points along each parameter finer
    for (config.train.minutes = 4; config.train.minutes < 6; config.train.minutes++)
        for (size_t n = 1; n < sizeof by_params / sizeof *by_params; n++)
            assert_int_equal(sdm_config_static_count(&config, n, 0), by_params[n]);
    // with six parameters minutes add points parameter by parameter, from 144 in all to 729
    static const size_t threes[] = {0, 2, 3, 4, 5, 6, 6};
    for (size_t minutes = 1; minutes < sizeof threes / sizeof *threes; minutes++) {
        config.train.minutes = (double)minutes;
        for (size_t i = 0; i < 6; i++)
            assert_int_equal(sdm_config_static_count(&config, 6, i), i < threes[minutes] ? 3 : 2);
        sdm_config c = config;
        sdm_config_set_static(&c, 6);
        assert_int_equal(c.data.n_static_counts, threes[minutes] == 6 ? 1 : 6);
        assert_int_equal(c.data.static_counts[0], 3);
    }
    config.train.minutes = budget;
    assert_int_equal(config.data.online, 4096);
    assert_int_equal(config.data.start, 3456);
    assert_int_equal(config.data.holdout, 100);
    assert_true(config.data.static_share == 0.1 && config.data.memory_gb == 6);
    assert_int_equal(config.data.workers, 0);
    assert_true(config.train.minutes == 0 && config.train.steps == 10 && config.train.samples == 0);
    assert_int_equal(config.train.batch, 256);
    assert_true(config.train.learning_rate == 3e-3 && config.train.warmup == 0.02);
    assert_int_equal(config.train.loss, SDM_LOSS_MSE);
    assert_true(config.train.near_weight == 0 && config.train.near_mm == 2 &&
                config.train.refine == 0.4);
    assert_int_equal(config.train.refine_batch, 32);
    assert_true(config.train.refine_rate == 3e-4 && config.train.average == 0.998);
    assert_true(config.train.evaluate_seconds == 20 && config.train.checkpoint_seconds == 60);
    assert_string_equal(config.output.folder, "runs/x");
    assert_true(config.seed == 1 && config.threads == 0);
}

static void test_values(void **state)
{
    (void)state;
    expect_ok(
        "---\r\nshape:\r\n  name: \"cochlea\"\r\n  options: {edge: 0.30, side: left, mean: 'a: "
        "b.ply'}\r\n"
        "  ranges:\r\n    a: [2, 5e0]\r\n    phi: [-0.5, .25]\r\n"
        "grid:\r\n  size: [3, 4, 5]\r\n  spacing: [0.5, 1, 2]\r\n  centre: [1, -2, 1e1]\r\n"
        "network: {depth: 0, width: +8, activation: relu, weights: f32}\r\ndata: {static: [3, "
        "4]}\r\n"
        "train: {minutes: 0, steps: 0, samples: 1000000, learning_rate: 1E-3, loss: huber}\r\n"
        "output: {folder: 2024/r\xC3\xBCn}\r\nseed: 18446744073709551615\r\nthreads: 2\r\n...\r\n",
        NULL);
    assert_string_equal(config.shape.name, "cochlea");
    assert_int_equal(config.shape.n_options, 3);
    assert_string_equal(config.shape.options[0].name, "edge");
    assert_string_equal(config.shape.options[0].value, "0.30");
    assert_string_equal(config.shape.options[2].value, "a: b.ply");
    assert_int_equal(config.shape.options[1].mark.line, 4);
    assert_int_equal(config.shape.n_ranges, 2);
    assert_true(config.shape.ranges[0].min == 2 && config.shape.ranges[0].max == 5);
    assert_true(config.shape.ranges[1].min == -0.5 && config.shape.ranges[1].max == 0.25);
    // The centre of the grid lies (n - 1) / 2 spacings from the centre of the first voxel.
    assert_true(config.grid.origin[0] == 0.5 && config.grid.origin[1] == -3.5 &&
                config.grid.origin[2] == 6);
    assert_true(config.grid.spacing[2] == 2 && config.grid.n[2] == 5);
    for (int i = 0; i < 9; i++) assert_true(config.grid.dir[i] == (i == 0 || i == 4 || i == 8));
    assert_int_equal(config.network.depth, 0);
    assert_int_equal(config.network.width, 8);
    assert_int_equal(config.network.activation, SDM_ACTIVATION_RELU);
    assert_int_equal(config.network.weights, SDM_WEIGHT_F32);
    assert_int_equal(config.data.n_static_counts, 2);
    assert_int_equal(config.data.static_counts[1], 4);
    assert_int_equal(config.train.samples, 1000000);
    assert_int_equal(config.train.loss, SDM_LOSS_HUBER);
    assert_true(config.train.learning_rate == 0.001);
    assert_string_equal(config.output.folder, "2024/r\xC3\xBCn");
    assert_true(config.seed == UINT64_MAX && config.threads == 2);

    // A section with only commented-out keys, an explicit origin, and no static grid.
    expect_ok("shape: {name: b}\nnetwork:\n  # depth: 3\ngrid: {size: [1, 1, 1], spacing: 1, "
              "origin: [7, 8, 9]}\n"
              "train: {minutes: 0.5}\ndata: {static: 0}\n",
              NULL);
    assert_true(config.grid.origin[0] == 7 && config.grid.origin[2] == 9);
    assert_int_equal(config.data.n_static_counts, 0);
}

static void test_overrides(void **state)
{
    static const char *const LIST[] = {
        "network.depth=4", "shape.ranges.a=[2,3]", "network.depth=5",
        "seed=7",          "grid.size=[7, 8, 9]",  "shape.options={edge: 0.5, side: left}"};
    static const char *const BUDGET[] = {"train.minutes=2", "train.samples=64"};
    static const char *const PLACE[] = {"grid.origin=[1,2,3]", "grid.centre=[0,0,0]"};
    char where[1200];
    (void)state;
    assert_int_equal(parse(BASE, LIST, 6), SDM_OK);
    assert_int_equal(config.network.depth, 5);
    assert_true(config.seed == 7 && config.grid.n[2] == 9 && config.grid.origin[0] == -3);
    assert_true(config.shape.ranges[0].min == 2 && config.shape.ranges[0].max == 3);
    assert_int_equal(config.shape.ranges[0].mark.override, 2);
    assert_string_equal(sdm_config_where(&config, config.shape.ranges[0].mark, where),
                        "argument 'shape.ranges.a=[2,3]'");
    assert_string_equal(sdm_config_where(&config, config.shape.mark, where), "x.yaml:1:9");
    assert_string_equal(sdm_config_where(&config, (sdm_mark){0}, where), "x.yaml");
    assert_int_equal(config.shape.n_options, 2);

    // Options of file and override are merged; an override replaces an option of the same name.
    expect_ok(
        "shape: {name: b, options: {edge: 1, side: left}}\ngrid: {size: [4, 5, 6], spacing: 1}\n"
        "train: {steps: 10}\n",
        "shape.options.edge=2");
    assert_int_equal(config.shape.n_options, 2);
    assert_string_equal(config.shape.options[0].value, "2");

    // An override of one budget (steps, minutes, samples) removes that of the file; two overrides
    // contradict each other. Of origin and centre the last override wins.
    assert_int_equal(parse(BASE, BUDGET, 2), SDM_E_CONFIG);
    assert_string_equal(err.text,
                        "argument 'train.samples=64': only one of train.minutes, train.steps and "
                        "train.samples may be positive, got 2");
    assert_int_equal(parse(BASE, BUDGET, 1), SDM_OK);
    assert_true(config.train.minutes == 2 && config.train.steps == 0);
    assert_int_equal(parse(BASE, PLACE, 1), SDM_OK);
    assert_true(config.grid.origin[0] == 1);
    assert_int_equal(parse(BASE, PLACE, 2), SDM_OK);
    assert_true(config.grid.origin[0] == -1.5);

    // A required key that the file lacks may come from an override.
    expect_ok("grid: {size: [4, 5, 6], spacing: 1}\ntrain: {steps: 10}\n", "shape.name=ball");
}

// network.kind decides which keys are allowed and their defaults.
static void test_kind_selects_keys_and_defaults(void **state)
{
    (void)state;
    expect_ok(BASE "network: {kind: deepsdf}\n", NULL);
    assert_int_equal(config.network.kind, SDM_NETWORK_DEEPSDF);
    assert_int_equal(config.network.depth, 8);
    assert_int_equal(config.network.width, 512);
    assert_int_equal(config.network.skip, 4);
    assert_int_equal(config.network.activation, SDM_ACTIVATION_RELU);
    assert_int_equal(config.network.output, SDM_OUTPUT_TANH);
    assert_int_equal(config.train.batch, 16);
    assert_int_equal(config.train.points, 512);
    assert_true(config.train.learning_rate == 5e-4 && config.train.eikonal == 0 &&
                config.train.clamp_mm == 0.5);
    expect_ok(BASE "network: {kind: imnet, depth: 3}\n", NULL);
    assert_int_equal(config.network.depth, 3);
    assert_int_equal(config.network.width, 2048);
    assert_int_equal(config.network.activation, SDM_ACTIVATION_LEAKY_RELU);
    assert_int_equal(config.network.output, SDM_OUTPUT_LINEAR);
    expect_ok(BASE "network: {kind: sdmnn, channels: 8}\n", NULL);
    assert_int_equal(config.network.depth, 4);
    assert_int_equal(config.network.channels, 8);
    assert_true(config.network.dropout == 0.1 && config.train.batch == 8 &&
                config.train.learning_rate == 1e-3);

    expect_ok(BASE "network: {kind: template}\n", NULL);
    assert_int_equal(config.network.kind, SDM_NETWORK_TEMPLATE);
    assert_int_equal(config.network.depth, 0);
    assert_int_equal(config.network.width, 64);
    assert_int_equal(config.network.weights, SDM_WEIGHT_I8);
    // Once the kind is chosen, keys with the default of `auto` have that of the kind.
    expect_ok(BASE "network: {kind: auto, width: 99}\n", NULL);
    sdm_config_choose_kind(&config, SDM_NETWORK_TEMPLATE);
    assert_int_equal(config.network.kind, SDM_NETWORK_TEMPLATE);
    assert_int_equal(config.network.depth, 0);
    assert_int_equal(config.network.width, 99);

    // An override of the kind: keys of the file that the new kind does not have are ignored, the
    // others still apply.
    static const char pod[] =
        BASE "network: {kind: pod, depth: 2, rank: 7, weights: f32}\ndata: {online: 9}\n";
    static const char *const to_deepsdf[] = {"network.kind=deepsdf", "network.width=64"};
    assert_int_equal(parse(pod, to_deepsdf, 2), SDM_OK);
    assert_int_equal(config.network.depth, 2);
    assert_int_equal(config.network.skip, 1);
    assert_true(config.train.learning_rate == 5e-4);
    assert_int_equal(config.network.width, 64);
    assert_int_equal(config.network.rank, 9);
    assert_int_equal(config.network.weights, SDM_WEIGHT_F32);
    assert_int_equal(config.data.online, 9);
    expect_ok(pod, "network.kind=pod");
    assert_int_equal(config.network.depth, 2);
    assert_int_equal(config.network.rank, 7);
    static const char *const there_and_back[] = {"network.kind=deepsdf", "network.kind=pod"};
    assert_int_equal(parse(pod, there_and_back, 2), SDM_OK);
    assert_int_equal(config.network.rank, 7);

    // weights: i8 is for pod only: ignored in the file when the kind is overridden, but a mistake
    // in an override.
    static const char bytes[] = BASE "network: {weights: i8}\n";
    expect_ok(bytes, "network.kind=sdmnn");
    assert_int_equal(config.network.weights, SDM_WEIGHT_F16);
    static const char *const wanted[] = {"network.kind=sdmnn", "network.weights=i8"};
    assert_int_equal(parse(bytes, wanted, 2), SDM_E_CONFIG);
    expect_mistake(BASE "network: {kind: imnet, weights: i8}\n", NULL,
                   "x.yaml:4:24: network.weights: i8 is for a network of kind pod or template; "
                   "imnet has f16 and f32");

    expect_mistake(BASE "network: {kind: deepsdf, rank: 7}\n", NULL,
                   "x.yaml:4:26: network.rank: a network of kind deepsdf has no such key, only "
                   "pod, template, auto");
    expect_mistake(BASE, "train.eikonal=1",
                   "argument 'train.eikonal=1': train.eikonal: a network of kind auto has no such "
                   "key, only sdmnn, "
                   "deepsdf, imnet");
    expect_mistake(
        BASE "network: {kind: imnet, depth: 0}\n", NULL,
        "x.yaml:4:24: network.depth: 0 is out of range (1 .. 16) for a network of kind imnet");
    expect_mistake(
        BASE "network: {block: 1}\n", NULL,
        "x.yaml:4:11: network.block: 1 is out of range (2 .. 16) for a network of kind auto");
    expect_mistake(
        BASE "network: {kind: deepsdf, depth: 3, skip: 3}\n", NULL,
        "x.yaml:4:36: network.skip: 3 is out of range (0 .. 2) for a network of kind deepsdf");
    expect_mistake(BASE "network: {kind: deepsdf, depth: 3, skip: x}\n", NULL,
                   "x.yaml:4:42: network.skip: needs an integer, got 'x'");
    expect_ok(BASE "network: {kind: deepsdf, depth: 3}\n", NULL);
    assert_int_equal(config.network.skip, 1);
    expect_mistake(BASE, "network.kind=podd",
                   "argument 'network.kind=podd': network.kind: 'podd' is not one of pod, sdmnn, "
                   "deepsdf, imnet, template, auto; did you mean 'pod'?");
}

static void test_mistakes(void **state)
{
    static const struct {
        const char *extra, *message;
    } CASES[] = {
        {"network: {dpth: 4}", "x.yaml:4:11: unknown key 'network.dpth'; did you mean 'depth'?"},
        {"netwrok: 4", "x.yaml:4:1: unknown key 'netwrok'; did you mean 'network'?"},
        {"depth: 4", "x.yaml:4:1: unknown key 'depth'; did you mean 'network.depth'?"},
        {"data: {qqqqqq: 4}",
         "x.yaml:4:8: unknown key 'data.qqqqqq'; the keys are static, online, start, holdout, "
         "sampling, static_share, memory_gb, workers"},
        {"network: {depth: 4, depth: 5}",
         "x.yaml:4:21: duplicate key 'network.depth' (first at line 4)"},
        {"seed: 1\nseed: 2", "x.yaml:5:1: duplicate key 'seed' (first at line 4)"},
        {"network: {depth: 99}", "x.yaml:4:18: network.depth: 99 is out of range (0 .. 16)"},
        {"network: {depth: -1}", "x.yaml:4:18: network.depth: -1 is out of range (0 .. 16)"},
        {"network: {depth: 4.0}", "x.yaml:4:18: network.depth: needs an integer, got '4.0'"},
        {"network: {depth: 1e1}", "x.yaml:4:18: network.depth: needs an integer, got '1e1'"},
        {"network: {depth: \"4\"}",
         "x.yaml:4:18: network.depth: needs an integer, got the text '4'"},
        {"network: {depth: [4]}", "x.yaml:4:18: network.depth: needs an integer, got a list of 1"},
        {"network: {depth: {a: 4}}", "x.yaml:4:18: network.depth: needs an integer, got a mapping"},
        {"network: {depth: }", "x.yaml:4:18: network.depth: needs an integer, got nothing"},
        {"network: 4", "x.yaml:4:10: network: needs keys with values, got '4'"},
        {"network: {activation: silo}", "x.yaml:4:23: network.activation: 'silo' is not one of "
                                        "silu, tanh, relu, leaky_relu; did you mean 'silu'?"},
        {"network: {activation: 1}",
         "x.yaml:4:23: network.activation: '1' is not one of silu, tanh, relu, "
         "leaky_relu"},
        {"data: {online: 99999999999999999999}",
         "x.yaml:4:16: data.online: 99999999999999999999 is out of range (0 .. 10000000)"},
        {"data: {static: 5000}", "x.yaml:4:16: data.static: 5000 is out of range (0 .. 1000)"},
        {"data: {static: [3, 0]}", "x.yaml:4:20: data.static: 0 is out of range (1 .. 1000)"},
        {"data: {static: []}",
         "x.yaml:4:16: data.static: needs auto, an integer or a list of 1 to 64, got a list of 0"},
        {"data: {static_share: nan}",
         "x.yaml:4:22: data.static_share: needs a finite number, got 'nan'"},
        {"data: {static_share: .inf}",
         "x.yaml:4:22: data.static_share: needs a finite number, got '.inf'"},
        {"data: {memory_gb: 1e999}",
         "x.yaml:4:19: data.memory_gb: needs a finite number, got '1e999'"},
        {"data: {static_share: 1.5}",
         "x.yaml:4:22: data.static_share: 1.5 is out of range (0 .. 1)"},
        {"data: {memory_gb: 0x10}",
         "x.yaml:4:19: data.memory_gb: needs a finite number, got '0x10'"},
        {"output: {folder: \"a\\nb\"}",
         "x.yaml:4:18: output.folder: a line break, tab or control character in a text"},
        {"output: {folder: ''}", "x.yaml:4:18: output.folder: needs a text, got the text ''"},
        {"methods: [{name: POD}]",
         "x.yaml:4:1: methods: this is an experiment, for sdmgen experiment, not a training"},
        {"seed: -1", "x.yaml:4:7: seed: -1 is out of range (0 .. 18446744073709551615)"},
        {"seed: 18446744073709551616",
         "x.yaml:4:7: seed: 18446744073709551616 is out of range (0 .. 18446744073709551615)"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        char text[512];
        snprintf(text, sizeof text, "%s%s\n", BASE, CASES[i].extra);
        expect_mistake(text, NULL, CASES[i].message);
    }
}

/* Either the grid is complete, or it is to be fitted to the shapes: with a number of voxels along
 * its longest edge, or with a spacing. */
static void test_fitted_grid(void **state)
{
    static const char *const TEXTS[] = {"", "grid: auto\n", "grid:\n", "grid: {voxels: 60}\n"};
    static const char WHOLE[] = "grid: {size: [4, 5, 6], spacing: 0.25, centre: [1, 2, 3]}\n";
    char text[256];
    (void)state;
    for (size_t i = 0; i < sizeof TEXTS / sizeof TEXTS[0]; i++) {
        snprintf(text, sizeof text, "shape: {name: b}\ntrain: {steps: 1}\n%s", TEXTS[i]);
        expect_ok(text, NULL);
        assert_true(config.grid.n[0] == 0 && config.grid.spacing[0] == 0 &&
                    config.grid_voxels == 60);
        assert_true(config.train.near_mm == 0 && config.train.clamp_mm == 0);
    }
    // with a spacing, the number of voxels follows from the shapes
    expect_ok(text, "grid.spacing=[0.2,0.4,0.3]");
    assert_true(config.grid.n[0] == 0 && config.grid.spacing[1] == 0.4 && config.grid_voxels == 0);
    expect_ok("shape: {name: b}\ntrain: {steps: 1}\n", "grid.voxels=100");
    assert_int_equal(config.grid_voxels, 100);

    // the result, and lengths in voxels that follow from it
    const sdm_grid grid = {{4, 5, 6}, {-1, 2, 3}, {0.3, 0.2, 0.4}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    sdm_config_set_grid(&config, &grid);
    assert_memory_equal(&config.grid, &grid, sizeof grid);
    assert_true(config.grid_voxels == 0 && config.train.near_mm == 0.4 &&
                config.train.clamp_mm == 0.1);
    sdm_text dump = {0};
    sdm_config_dump(&config, &dump);
    assert_non_null(strstr(dump.data, "size: [4, 5, 6]"));
    assert_null(strstr(dump.data, "voxels:"));
    expect_ok(dump.data, NULL);
    assert_memory_equal(&config.grid, &grid, sizeof grid);
    sdm_text_dispose(&dump);

    // lengths that were given stay
    expect_ok("shape: {name: b}\ntrain: {steps: 1, near_mm: 0.7}\n", NULL);
    sdm_config_set_grid(&config, &grid);
    assert_true(config.train.near_mm == 0.7);

    // overrides replace what they exclude
    snprintf(text, sizeof text, "shape: {name: b}\ntrain: {steps: 1}\n%s", WHOLE);
    expect_ok(text, "grid=auto");
    assert_true(config.grid.n[0] == 0 && config.grid.spacing[0] == 0 && config.grid_voxels == 60);
    expect_ok(text, "grid.voxels=32");
    assert_true(config.grid.n[0] == 0 && config.grid.spacing[0] == 0 && config.grid_voxels == 32);
    static const char *const LATE[] = {"grid.voxels=32", "grid={size: [7, 7, 7], spacing: 2}"};
    if (sdm_config_parse("x.yaml", text, strlen(text), LATE, 2, &config, &err))
        fail_msg("%s", err.text);
    assert_true(config.grid.n[0] == 7 && config.grid.origin[0] == -6 && config.grid_voxels == 0);
}

static void test_grid_keys_that_do_not_fit(void **state)
{
#define ALLOWED                                                                                    \
    "; give size and spacing, and origin or centre if you like; or spacing, or voxels, or "        \
    "nothing (grid: auto) for a grid that is fitted to the shapes"
    static const struct {
        const char *keys, *message;
    } CASES[] = {
        {"{size: [4, 5, 6]}", "x.yaml:2:8: grid: size does not determine a grid" ALLOWED},
        {"{centre: [4, 5, 6]}", "x.yaml:2:8: grid: centre does not determine a grid" ALLOWED},
        {"{spacing: 1, origin: [4, 5, 6]}",
         "x.yaml:2:20: grid: spacing, origin do not determine a grid" ALLOWED},
        {"{voxels: 50, spacing: 1}",
         "x.yaml:2:20: grid: spacing, voxels do not determine a grid" ALLOWED},
        {"{size: [4, 5, 6], spacing: 1, voxels: 50}",
         "x.yaml:2:37: grid: size, spacing, voxels do not determine a grid" ALLOWED},
        {"{voxels: 15}", "x.yaml:2:16: grid.voxels: 15 is out of range (16 .. 4096)"},
        {"automatic", "x.yaml:2:7: grid: needs auto or keys with values, got 'automatic'"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        char text[256];
        snprintf(text, sizeof text, "shape: {name: b}\ngrid: %s\ntrain: {steps: 1}\n",
                 CASES[i].keys);
        expect_mistake(text, NULL, CASES[i].message);
    }
}

static void test_rules_between_keys(void **state)
{
    static const char NAME_GRID[] = "shape: {name: b}\ngrid: {size: [4, 5, 6], spacing: 1}\n";
    char text[1024];
    (void)state;
    snprintf(text, sizeof text, "%strain: {steps: 10,\n  minutes: 3}\n", NAME_GRID);
    expect_mistake(text, NULL,
                   "x.yaml:4:3: only one of train.minutes, train.steps and train.samples may be "
                   "positive, got 2");
    expect_mistake(NAME_GRID, NULL,
                   "x.yaml:1:1: missing key: one of train.minutes, train.steps and train.samples "
                   "must be positive");
    snprintf(text, sizeof text, "%strain: {steps: -3}\n", NAME_GRID);
    expect_mistake(text, NULL, "x.yaml:3:16: train.steps: -3 is out of range (0 .. 1000000000000)");
    expect_mistake(
        BASE, "train.steps=0",
        "argument 'train.steps=0': the training has no budget: one of train.minutes, train.steps "
        "and train.samples must be positive");
    snprintf(text, sizeof text, "%strain: {minutes: 0}\n", NAME_GRID);
    expect_mistake(text, NULL,
                   "x.yaml:3:9: the training has no budget: one of train.minutes, train.steps and "
                   "train.samples must be positive");

    expect_mistake("", NULL,
                   "x.yaml:1:1: missing key 'shape.name'; e.g. name: cochlea\n"
                   "x.yaml:1:1: missing key: one of train.minutes, train.steps and train.samples "
                   "must be positive");
    expect_mistake("shape: {name: b}\ngrid: {size: [4, 0, 6.5], spacing: -1, centre: [0, 0], "
                   "origin: [1, 2, 3]}\n"
                   "train: {steps: 1}\n",
                   NULL,
                   "x.yaml:2:18: grid.size.y: 0 is out of range (1 .. 1048576)\n"
                   "x.yaml:2:21: grid.size.z: needs an integer, got '6.5'\n"
                   "x.yaml:2:36: grid.spacing: -1 is out of range (1e-06 .. 1000000)\n"
                   "x.yaml:2:48: grid.centre: needs three numbers [x, y, z], got a list of 2\n"
                   "x.yaml:2:56: only one of grid.origin and grid.centre may be given");
    expect_mistake("shape: {name: b}\ngrid: {size: [1048576, 1048576, 1048576], spacing: "
                   "1}\ntrain: {steps: 1}\n",
                   NULL,
                   "x.yaml:2:8: grid.size: grid of 1048576 x 1048576 x 1048576 voxels is more than "
                   "memory can hold");
    expect_mistake(
        "shape: {name: b, ranges: {a: [2, 2], b: 3, c: [1], C: [1, 2]}, options: {d: [1], e: }}\n"
        "grid: {size: [4, 5, 6], spacing: 1}\ntrain: {steps: 1}\n",
        NULL,
        "x.yaml:1:30: shape.ranges.a: [2, 2] is empty; the first number is the smaller one\n"
        "x.yaml:1:41: shape.ranges.b: needs two numbers [min, max], got '3'\n"
        "x.yaml:1:47: shape.ranges.c: needs two numbers [min, max], got a list of 1\n"
        "x.yaml:1:52: shape.ranges: 'C' is no name; use a-z, 0-9 and _, first a letter\n"
        "x.yaml:1:77: shape.options.d: needs a text, got a list of 1\n"
        "x.yaml:1:85: shape.options.e: needs a text, got nothing");
}

static void test_override_mistakes(void **state)
{
    static const struct {
        const char *override, *message;
    } CASES[] = {
        {"network.dpth=4",
         "argument 'network.dpth=4': unknown key 'network.dpth'; did you mean 'network.depth'?"},
        {"depth=4", "argument 'depth=4': unknown key 'depth'; did you mean 'network.depth'?"},
        {"sed=4", "argument 'sed=4': unknown key 'sed'; did you mean 'seed'?"},
        {"network.depth", "argument 'network.depth': not of the form key=value"},
        {"=4", "argument '=4': not of the form key=value"},
        {"network.depth=",
         "argument 'network.depth=': network.depth: needs an integer, got nothing"},
        {"network=", "argument 'network=': network: needs keys with values, got nothing"},
        {"network.depth.x=4",
         "argument 'network.depth.x=4': network.depth: needs an integer, got a mapping"},
        {"network.depth=17",
         "argument 'network.depth=17': network.depth: 17 is out of range (0 .. 16)"},
        {"a.b.c.d.e.f.g.h.i=4", "argument 'a.b.c.d.e.f.g.h.i=4': unknown key"},
        {"..=4",
         "argument '..=4': unknown key ''; the keys are seed, threads, shape, grid, network, data, "
         "train, output"},
        {"shape.ranges.a=[3",
         "argument 'shape.ranges.a=[3': not valid YAML: did not find expected ',' or ']' (while "
         "parsing a flow sequence from line 1)"},
        {"seed=&a 3", "argument 'seed=&a 3': anchor '&a'; anchors are not allowed"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++)
        expect_mistake(BASE, CASES[i].override, CASES[i].message);
}

static void test_mistakes_are_sorted_and_counted(void **state)
{
    static const char *const LATE[] = {"network.depth=99", "network.width=1"};
    char text[4096] = BASE, line[64];
    (void)state;
    // Messages are sorted by position although the checks find them in another order; those on
    // arguments come last. At most 20 are listed, then a count of the rest.
    for (int i = 0; i < 30; i++) {
        snprintf(line, sizeof line, "unknown%c%d: 3\n", 'a' + i % 26, i);
        strcat(text, line);
    }
    assert_int_equal(parse(text, LATE, 2), SDM_E_CONFIG);
    size_t lines = 1, last = 0;
    for (const char *p = err.text; (p = strchr(p, '\n')); p++) {
        size_t at = 0;
        if (sscanf(p + 1, "x.yaml:%zu:", &at) == 1) assert_true(at > last);
        last = at;
        lines++;
    }
    assert_int_equal(lines, 21);
    assert_non_null(strstr(err.text, "x.yaml:23:1: unknown key"));
    assert_non_null(strstr(err.text, "\n... and 12 more"));

    // Three mistakes in the file and one in an argument give four lines. The name that is missing
    // is that of the unknown key, which alone is told.
    assert_int_equal(
        parse("shape: {nam: b}\ngrid: {size: [4, 5], spacing: 1}\ntrain: {steps: x}\n", LATE, 1),
        SDM_E_CONFIG);
    assert_string_equal(err.text,
                        "x.yaml:1:9: unknown key 'shape.nam'; did you mean 'name'?\n"
                        "x.yaml:2:14: grid.size: needs three integers [x, y, z], got a list of 2\n"
                        "x.yaml:3:16: train.steps: needs an integer, got 'x'\n"
                        "argument 'network.depth=99': network.depth: 99 is out of range (0 .. 16)");

    // So it is with the grid, the budget, and the key of a section.
    assert_int_equal(parse("shape: {name: b}\ngrid: {size: [4, 5, 5], space: 3}\n"
                           "train: {stepps: 20}\n",
                           NULL, 0),
                     SDM_E_CONFIG);
    assert_string_equal(err.text, "x.yaml:2:25: unknown key 'grid.space'; did you mean 'spacing'?\n"
                                  "x.yaml:3:9: unknown key 'train.stepps'; did you mean 'steps'?");
    assert_int_equal(parse("shape: {name: b}\ntrian: {steps: 20}\n", NULL, 0), SDM_E_CONFIG);
    assert_string_equal(err.text, "x.yaml:2:1: unknown key 'trian'; did you mean 'train'?");

    // Long values are cut, and long file names cannot cut a message: only whole lines, then the
    // count of the rest.
    char name[SDM_PATH_TEXT_MAX], value[101];
    memset(name, 'n', sizeof name - 1);
    name[sizeof name - 1] = 0;
    memset(value, 'z', sizeof value - 1);
    value[sizeof value - 1] = 0;
    snprintf(text, sizeof text, "%sseed: %s\nthreads: x\ndepth: 3\nwidth: 4\nrank: 4\n", BASE,
             value);
    assert_int_equal(sdm_config_parse(name, text, strlen(text), NULL, 0, &config, &err),
                     SDM_E_CONFIG);
    value[60] = 0;
    char line_1[1500];
    snprintf(line_1, sizeof line_1, "%s:4:7: seed: needs an integer, got '%s...'\n", name, value);
    assert_memory_equal(err.text, line_1, strlen(line_1));
    assert_string_equal(strstr(err.text, "\n... and "), "\n... and 2 more");
    for (size_t n = 600; n <= sizeof name; n++) {
        // The count of the rest is complete wherever the buffer ends.
        size_t more = 0;
        int end = 0;
        assert_int_equal(
            sdm_config_parse(name + sizeof name - n, text, strlen(text), NULL, 0, &config, &err),
            SDM_E_CONFIG);
        const char *tail = strrchr(err.text, '\n');
        if (tail[1] != '.') continue; // all messages fit, so there is no count
        assert_int_equal(sscanf(tail, " ... and %zu more%n", &more, &end), 1);
        assert_true(end > 0 && tail[end] == 0 && more >= 1);
    }
}

static void test_folder_is_derived_from_name(void **state)
{
    static const char *const NAMES[][2] = {{"a/b/cochlea.yaml", "runs/cochlea"},
                                           {"my.exp.yml", "runs/my.exp"},
                                           {"plain", "runs/plain"},
                                           {".yaml", "runs/.yaml"},
                                           {"dir/", "runs/config"},
                                           {"", "runs/config"},
                                           {"a\nb\xFF.yaml", "runs/a_b_"},
                                           {"\xC3\xA4.yaml", "runs/\xC3\xA4"}};
    (void)state;
    for (size_t i = 0; i < sizeof NAMES / sizeof NAMES[0]; i++) {
        assert_int_equal(sdm_config_parse(NAMES[i][0], BASE, strlen(BASE), NULL, 0, &config, &err),
                         SDM_OK);
        assert_string_equal(config.output.folder, NAMES[i][1]);
    }
}

/* The text stored in a model: two files that differ only in threads, workers and output folder
 * give the same text, another seed gives another. */
static void test_stored_text_has_no_machine_keys(void **state)
{
    static const char *const NAMES[] = {"here.yaml", "there/too.yaml", "here.yaml"};
    static const char *const LINES[] = {
        "threads: 1\n", "threads: 3\ndata: {workers: 2}\noutput: {folder: x}\n", "seed: 2\n"};
    sdm_text dump[3] = {{0}};
    (void)state;
    for (int i = 0; i < 3; i++) {
        char text[256];
        snprintf(text, sizeof text, BASE "%s", LINES[i]);
        assert_int_equal(sdm_config_parse(NAMES[i], text, strlen(text), NULL, 0, &config, &err),
                         SDM_OK);
        sdm_config_strip(&config);
        sdm_config_dump(&config, &dump[i]);
        assert_false(dump[i].failed);
        assert_string_equal(config.file, "");
    }
    assert_string_equal(dump[0].data, dump[1].data);
    assert_string_not_equal(dump[0].data, dump[2].data);
    for (int i = 0; i < 3; i++) sdm_text_dispose(&dump[i]);
}

static void test_locale_does_not_matter(void **state)
{
    static const char *const COMMA[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE"};
    (void)state;
    for (size_t i = 0; i < 4; i++)
        if (setlocale(LC_ALL, COMMA[i])) break;
    // Whether or not this machine has a locale with decimal commas: numbers are read with a point,
    // never with a comma.
    expect_ok(BASE "data: {static_share: 0.25}\n", NULL);
    assert_true(config.data.static_share == 0.25);
    expect_mistake(BASE "data: {static_share: \"0,25\"}\n", NULL,
                   "x.yaml:4:22: data.static_share: needs a finite number, got the text '0,25'; a "
                   "decimal number has a point: 0.25");
    setlocale(LC_ALL, "C");
}

static void test_wrong_arguments_are_refused(void **state)
{
    static const char *const NOTHING[] = {NULL};
    char name[SDM_PATH_TEXT_MAX + 1];
    (void)state;
    memset(name, 'n', sizeof name - 1);
    name[sizeof name - 1] = 0;
    assert_int_equal(sdm_config_parse(NULL, BASE, 3, NULL, 0, &config, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_parse("x", NULL, 3, NULL, 0, &config, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_parse("x", BASE, 3, NULL, 1, &config, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_parse("x", BASE, 3, NOTHING, 1, &config, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_parse("x", BASE, 3, NULL, 0, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_parse(name, BASE, strlen(BASE), NULL, 0, &config, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_parse("x", "a: [", 4, NULL, 0, &config, NULL), SDM_E_CONFIG);
    assert_int_equal(sdm_config_parse("x", NULL, 0, NULL, 0, &config, NULL), SDM_E_CONFIG);
    assert_int_equal(sdm_config_read(NULL, NULL, 0, &config, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_read("x", NULL, 0, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_config_read("no/such/file.yaml", NULL, 0, &config, &err), SDM_E_IO);
    assert_non_null(strstr(err.text, "no/such/file.yaml"));
    assert_int_equal(sdm_config_read(".", NULL, 0, &config, &err), SDM_E_IO);
}

/* Each allocation fails once, which must give SDM_E_NOMEM. */
static void test_each_allocation_may_fail(void **state)
{
    static const char *const LIST[] = {"network.depth=4"};
    (void)state;
    sdm_status s = SDM_E_NOMEM;
    unsigned long n = 1;
    for (; s == SDM_E_NOMEM && n < 100; n++) {
        sdm_alloc_fail_after(n);
        s = parse(BASE, LIST, 1);
        sdm_alloc_fail_after(0);
        assert_true(s == SDM_OK || s == SDM_E_NOMEM);
    }
    assert_int_equal(s, SDM_OK);
    assert_true(n > 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_defaults),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_overrides),
        cmocka_unit_test(test_kind_selects_keys_and_defaults),
        cmocka_unit_test(test_mistakes),
        cmocka_unit_test(test_fitted_grid),
        cmocka_unit_test(test_grid_keys_that_do_not_fit),
        cmocka_unit_test(test_rules_between_keys),
        cmocka_unit_test(test_override_mistakes),
        cmocka_unit_test(test_mistakes_are_sorted_and_counted),
        cmocka_unit_test(test_folder_is_derived_from_name),
        cmocka_unit_test(test_stored_text_has_no_machine_keys),
        cmocka_unit_test(test_locale_does_not_matter),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_each_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
