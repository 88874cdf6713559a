/* Configuration: the strict subset of YAML, its limits, and random configurations that survive
 * writing and reading.
 * Tests: yaml_tree.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/config.h"
#include "sdm/internal/rng.h"

#define BASE "shape: {name: ball}\ngrid: {size: [4, 5, 6], spacing: 1}\ntrain: {steps: 10}\n"

static sdm_config config, again; /* too large for some stacks */
static sdm_error err;

static sdm_status parse(const char *text, size_t size)
{
    memset(&err, 0, sizeof err);
    return sdm_config_parse("x.yaml", text, size, NULL, 0, &config, &err);
}

static void test_strict_yaml(void **state)
{
    static const struct {
        const char *text, *message;
    } CASES[] = {
        {"grid:\n\tsize: 3\n", "x.yaml:2:1: a tab in the indentation; use spaces"},
        {"grid:\n  - a\n  \tb: 3\n", "x.yaml:3:3: a tab in the indentation; use spaces"},
        {"# \xC3\xA4\ndata:\n  -\tb\n", "x.yaml:3:4: a tab where YAML wants spaces"},
        {"# \xC3\xA4\xC3\xB6\nseed: \t\t%x\n",
         "x.yaml:2:9: not valid YAML: found character that cannot start any "
         "token (while scanning for the next token from line 2)"},
        {"\xEF\xBB\xBFseed: 3\n",
         "x.yaml:1:1: a byte order mark; save the text as UTF-8 without it"},
        {"seed: 3\n# \xEF\xBB\xBF\n",
         "x.yaml:2:3: a byte order mark; save the text as UTF-8 without it"},
        {"\xFF\xFEs\n", "x.yaml:1:1: the text is UTF-16; save it as UTF-8"},
        {"# \xC3\xA4 \xC3\n", "x.yaml:1:5: byte 0xC3 is not valid UTF-8; save the text as UTF-8"},
        {"# \xC0\x80\n", "x.yaml:1:3: byte 0xC0 is not valid UTF-8; save the text as UTF-8"},
        {"# \xED\xA0\x80\n", "x.yaml:1:3: byte 0xED is not valid UTF-8; save the text as UTF-8"},
        {"# \xF4\x90\x80\x80\n",
         "x.yaml:1:3: byte 0xF4 is not valid UTF-8; save the text as UTF-8"},
        {"# \xE2\x82", "x.yaml:1:3: byte 0xE2 is not valid UTF-8; save the text as UTF-8"},
        {"a: 1\rb: \x01\r\n", "x.yaml:2:4: control character U+0001; remove it"},
        {"a: \xC2\x85 3\n", "x.yaml:1:4: control character U+0085; remove it"},
        {"a: 1\n---\nb: 2\n", "x.yaml:2:1: a second document; one file holds one configuration"},
        {"%YAML 1.1\n---\na: 1\n",
         "x.yaml:1:1: a %YAML or %TAG directive; directives are not allowed"},
        {"%TAG ! x:\n---\na: 1\n",
         "x.yaml:1:1: a %YAML or %TAG directive; directives are not allowed"},
        {"seed: *a\n", "x.yaml:1:7: alias '*a'; aliases are not allowed"},
        {"[1, 2]\n", "x.yaml:1:1: the configuration: needs keys with values, got a list of 2"},
        {"cochlea\n", "x.yaml:1:1: the configuration: needs keys with values, got 'cochlea'"},
        {"grid: {size: [1, 2\n",
         "x.yaml:2:1: not valid YAML: did not find expected ',' or ']' (while parsing a flow "
         "sequence from line 1)"},
        {"depth:4\nseed: 3\n",
         "x.yaml:2:5: not valid YAML: mapping values are not allowed in this context (is a space "
         "missing behind a ':' near here?)"},
        {BASE "seed: !!int 3\n", "x.yaml:4:7: tag 'tag:yaml.org,2002:int'; tags are not allowed"},
        {BASE "seed: ! 3\n", "x.yaml:4:7: tag '!'; tags are not allowed"},
        {BASE "data: &d {online: 3}\n", "x.yaml:4:7: anchor '&d'; anchors are not allowed"},
        {BASE "&k seed: 3\n", "x.yaml:4:1: anchor '&k'; anchors are not allowed"},
        {BASE "? [a, b]\n: {c: 3}\nseed: 3\n", "x.yaml:4:3: a key must be a single name"},
        {BASE "output: {folder: \"a\\0b\"}\n", "x.yaml:4:18: a NUL character in a text; remove it"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof CASES / sizeof CASES[0]; i++) {
        assert_int_equal(parse(CASES[i].text, strlen(CASES[i].text)), SDM_E_CONFIG);
        assert_string_equal(err.text, CASES[i].message);
    }
    // A NUL byte is refused as a control character; it does not end the text.
    assert_int_equal(parse("seed: 3\n\0# x\n", 12), SDM_E_CONFIG);
    assert_string_equal(err.text, "x.yaml:2:1: control character U+0000; remove it");
}

static void test_size_depth_and_count_limits(void **state)
{
    const size_t limit = (size_t)1 << 20;
    char *text = malloc(limit + 1);
    (void)state;
    assert_non_null(text);

    // Size: a file of exactly the limit is read, one byte more is refused.
    memset(text, '#', limit + 1);
    memcpy(text, BASE, strlen(BASE));
    assert_int_equal(parse(text, limit), SDM_OK);
    assert_int_equal(parse(text, limit + 1), SDM_E_CONFIG);
    assert_string_equal(err.text, "x.yaml:1:1: 1048577 bytes, more than the allowed 1048576");

    // Nesting: depth 32 is parsed (and then refused as a value of `data`), depth 33 is refused at
    // its position, and so is a megabyte of brackets.
    char deep[128];
    snprintf(deep, sizeof deep, "%s%.31s1%.31s", "data: ", "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[",
             "]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]");
    assert_int_equal(parse(deep, strlen(deep)), SDM_E_CONFIG);
    assert_non_null(strstr(err.text, "x.yaml:1:7: data: needs keys with values, got a list of 1"));
    snprintf(deep, sizeof deep, "%s%.32s1%.32s", "data: ", "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[",
             "]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]]");
    assert_int_equal(parse(deep, strlen(deep)), SDM_E_CONFIG);
    assert_string_equal(err.text, "x.yaml:1:38: nesting deeper than 32");
    memset(text, '[', limit);
    assert_int_equal(parse(text, limit), SDM_E_CONFIG);
    assert_string_equal(err.text, "x.yaml:1:33: nesting deeper than 32");

    // Number of values.
    for (size_t i = 0; i < limit; i += 2) memcpy(text + i, i ? "a," : " [", 2);
    assert_int_equal(parse(text, limit), SDM_E_CONFIG);
    assert_string_equal(err.text,
                        "x.yaml:1:8193: more than 4096 values; a configuration is smaller");
    free(text);
}

/* A configuration cut at any byte gives an error with a message or a smaller configuration,
 * never a crash. */
static void test_truncated_text_is_safe(void **state)
{
    static const char TEXT[] =
        "shape:\n  name: \"b\\u00e4\"\n  options: {a: 'it''s', b: |\n    x\n  }\n"
        "  ranges:\n    - [1, 2]\n    - ? x\n      : y\ngrid: {size: [4, 5, 6], spacing: 1}\n";
    (void)state;
    for (size_t n = 0; n < sizeof TEXT; n++) {
        assert_int_equal(parse(TEXT, n), SDM_E_CONFIG);
        assert_memory_equal(err.text, "x.yaml:", 7);
    }
}

static uint64_t counter;

static int64_t random_int(int64_t low, int64_t high)
{
    return low + (int64_t)sdm_rng_below(7, 1, counter++, (uint64_t)(high - low) + 1);
}

/* A random number in [low, high]: often one of the ends, else uniform or concentrated near low. */
static double random_real(double low, double high)
{
    const double u = sdm_rng_uniform(7, 2, counter++);
    const int64_t kind = random_int(0, 7);
    if (kind == 0) return low;
    if (kind == 1) return high;
    const double v =
        kind < 5 ? low + u * (high - low) : low + (high - low) * u * u * u * u * u * u * u * u;
    return v < low ? low : v > high ? high : v;
}

static void random_text(char *out, size_t max)
{
    static const char *const PIECES[] = {
        "a", "\"", "\\", ":", " #", "'", "{", "\xC3\xA9", "\xF0\x9F\x90\x9A", "- ", "%", "0"};
    size_t length = (size_t)random_int(1, 30) == 1 ? max : (size_t)random_int(1, 40), used = 0;
    while (used + 4 <= length && used + 4 <= max) {
        const char *piece = PIECES[random_int(0, 11)];
        memcpy(out + used, piece, strlen(piece));
        used += strlen(piece);
    }
    if (!used) out[used++] = 'x';
    out[used] = 0;
}

static void random_shape(sdm_config *c)
{
    random_text(c->shape.name, SDM_NAME_MAX - 1);
    c->shape.n_options = (size_t)random_int(0, random_int(0, 9) ? 3 : SDM_MAX_OPTIONS);
    for (size_t i = 0; i < c->shape.n_options; i++) {
        snprintf(c->shape.options[i].name, SDM_NAME_MAX, "o%zu_name", i);
        random_text(c->shape.options[i].value, SDM_PATH_TEXT_MAX - 1);
    }
    c->shape.n_ranges = (size_t)random_int(0, random_int(0, 9) ? 3 : SDM_MAX_PARAMS);
    for (size_t i = 0; i < c->shape.n_ranges; i++) {
        snprintf(c->shape.ranges[i].name, SDM_NAME_MAX, "r%zu", i);
        c->shape.ranges[i].min = random_real(-1e9, 1e8);
        c->shape.ranges[i].max = random_real(1.1e8, 1e9);
    }
    for (int i = 0; i < 3; i++) {
        c->grid.n[i] = random_int(1, 1 << 19);
        c->grid.spacing[i] = random_real(1e-6, 1e6);
        c->grid.origin[i] = random_real(-1e9, 1e9);
        c->grid.dir[4 * i] = 1;
    }
}

// Keys that the kind of network does not have keep their defaults.
static void random_network(sdm_config *c)
{
    const sdm_network_kind kind = (sdm_network_kind)random_int(0, 3);
    const bool pod = kind == SDM_NETWORK_POD, sdmnn = kind == SDM_NETWORK_SDMNN,
               points = !pod && !sdmnn;
    c->network.kind = kind;
    c->network.depth = (int)random_int(pod ? 0 : 1, sdmnn ? 6 : 16);
    c->network.width = (int)random_int(8, 4096);
    c->network.rank = pod ? (int)random_int(1, 256) : 9;
    c->network.levels = pod ? (int)random_int(1, 8) : 3;
    c->network.block = pod || sdmnn ? (int)random_int(pod ? 2 : 1, 16) : 4;
    c->network.modes = pod ? (int)random_int(8, 2048) : 512;
    c->network.degree = pod ? (int)random_int(0, 12) : 6;
    c->network.input_degree = pod ? (int)random_int(1, 8) : 4;
    c->network.channels = sdmnn ? (int)random_int(1, 512) : 16;
    c->network.dropout = sdmnn ? random_real(0, 0.9) : 0.1;
    c->network.skip = kind == SDM_NETWORK_DEEPSDF ? (int)random_int(0, c->network.depth - 1) : 4;
    c->network.output = points ? (sdm_output)random_int(0, 1) : SDM_OUTPUT_LINEAR;
    c->network.activation = (sdm_activation)random_int(0, 3);
    c->network.weights = (sdm_weight_type)random_int(0, pod ? 2 : 1);
    c->train.points = points ? (int)random_int(8, 1048576) : 512;
    c->train.eikonal = pod ? 0 : random_real(0, 1000);
    c->train.refine = pod ? random_real(0, 1) : 0.4;
    c->train.refine_batch = pod ? (int)random_int(1, 4096) : 32;
    c->train.refine_rate = pod ? random_real(1e-9, 1) : 3e-4;
}

static void random_config(sdm_config *c)
{
    memset(c, 0, sizeof *c);
    random_shape(c);
    random_network(c);
    c->data.n_static_counts = (size_t)random_int(0, 5);
    for (size_t i = 0; i < c->data.n_static_counts; i++)
        c->data.static_counts[i] = random_int(1, 1000);
    c->data.online = random_int(0, 10000000);
    c->data.start = random_int(0, 1000000);
    c->data.holdout = random_int(1, 100000);
    c->data.static_share = random_real(0, 1);
    c->data.memory_gb = random_real(0.001, 1e6);
    c->data.workers = (int)random_int(0, 1024);
    const int64_t budget = random_int(0, 2);
    if (budget == 0) c->train.minutes = random_real(1e-9, 1e6);
    if (budget == 1) c->train.steps = random_int(1, 1000000000000);
    if (budget == 2) c->train.samples = random_int(1, 1000000000000000);
    c->train.batch = (int)random_int(1, 65536);
    c->train.learning_rate = random_real(1e-9, 1);
    c->train.warmup = random_real(0, 0.5);
    c->train.loss = (sdm_loss)random_int(0, 3);
    c->train.clamp_mm = random_real(1e-6, 1e6);
    c->train.near_weight = random_real(0, 100);
    c->train.near_mm = random_real(1e-6, 1e6);
    c->train.average = random_real(0, 0.99999);
    c->train.evaluate_seconds = random_real(0.001, 1e6);
    c->train.checkpoint_seconds = random_real(0.001, 1e6);
    random_text(c->output.folder, SDM_PATH_TEXT_MAX - 1);
    c->seed = sdm_rng_below(7, 3, counter++, UINT64_MAX);
    c->threads = (int)random_int(0, 1024);
}

/* Compares everything but the name of the file and the positions in it. */
static void expect_equal(const sdm_config *a, const sdm_config *b)
{
    assert_string_equal(a->shape.name, b->shape.name);
    assert_int_equal(a->shape.n_options, b->shape.n_options);
    for (size_t i = 0; i < a->shape.n_options; i++) {
        assert_string_equal(a->shape.options[i].name, b->shape.options[i].name);
        assert_string_equal(a->shape.options[i].value, b->shape.options[i].value);
    }
    assert_int_equal(a->shape.n_ranges, b->shape.n_ranges);
    for (size_t i = 0; i < a->shape.n_ranges; i++) {
        assert_string_equal(a->shape.ranges[i].name, b->shape.ranges[i].name);
        assert_memory_equal(&a->shape.ranges[i].min, &b->shape.ranges[i].min, sizeof(double));
        assert_memory_equal(&a->shape.ranges[i].max, &b->shape.ranges[i].max, sizeof(double));
    }
    // Both were zeroed before, so memcmp may include padding.
    assert_memory_equal(&a->grid, &b->grid, sizeof a->grid);
    assert_memory_equal(&a->network, &b->network, sizeof a->network);
    assert_memory_equal(&a->data, &b->data, sizeof a->data);
    assert_memory_equal(&a->train, &b->train, sizeof a->train);
    assert_string_equal(a->output.folder, b->output.folder);
    assert_true(a->seed == b->seed && a->threads == b->threads);
}

static void test_written_config_reads_back(void **state)
{
    (void)state;
    for (int i = 0; i < 300; i++) {
        sdm_text dump = {0};
        random_config(&config);
        sdm_config_dump(&config, &dump);
        assert_false(dump.failed);
        if (sdm_config_parse("d.yaml", dump.data, dump.size, NULL, 0, &again, &err))
            fail_msg("%s\n%s", err.text, dump.data);
        expect_equal(&config, &again);
        sdm_text_dispose(&dump);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_strict_yaml),
        cmocka_unit_test(test_size_depth_and_count_limits),
        cmocka_unit_test(test_truncated_text_is_safe),
        cmocka_unit_test(test_written_config_reads_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
