/* The key shape.distribution: words, mappings, overrides, dumps and mistakes. Tests:
 * distribution_key.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "config_tools.h"

static const sdm_config_distribution *distribution_of(const char *name)
{
    for (size_t i = 0; i < config.shape.n_distributions; i++)
        if (!strcmp(config.shape.distributions[i].name, name))
            return &config.shape.distributions[i];
    return NULL;
}

#define SHAPE_WITH(text)                                                                           \
    "shape: {name: b, distribution: " text "}\n"                                                   \
    "grid: {size: [4, 5, 6], spacing: 1}\ntrain: {steps: 1}\n"

static void test_distributions(void **state)
{
    (void)state;
    expect_ok(BASE, NULL);
    assert_int_equal(config.shape.distribution.choice, SDM_DISTRIBUTION_OF_SHAPE);
    expect_ok(SHAPE_WITH("normal"), NULL);
    assert_int_equal(config.shape.distribution.choice, SDM_DISTRIBUTION_SET_NORMAL);
    assert_int_equal(config.shape.distribution.mark.column, 32);
    // an override replaces the word, or merges with the mapping
    expect_ok(SHAPE_WITH("normal"), "shape.distribution=uniform");
    assert_int_equal(config.shape.distribution.choice, SDM_DISTRIBUTION_SET_UNIFORM);
    expect_ok(SHAPE_WITH("{a: uniform, c: {deviation: 2, mean: -1e3}}"),
              "shape.distribution={a: normal, d: shape}");
    assert_int_equal(config.shape.n_distributions, 3);
    assert_int_equal(distribution_of("a")->choice, SDM_DISTRIBUTION_SET_NORMAL);
    assert_int_equal(distribution_of("a")->mark.override, 1);
    assert_int_equal(distribution_of("d")->choice, SDM_DISTRIBUTION_OF_SHAPE);
    assert_int_equal(distribution_of("c")->choice, SDM_DISTRIBUTION_FIGURES);
    assert_true(distribution_of("c")->mean == -1e3 && distribution_of("c")->deviation == 2);
    expect_ok(SHAPE_WITH("{a: uniform}"), "shape.distribution=normal");
    assert_int_equal(config.shape.n_distributions, 0);
    assert_int_equal(config.shape.distribution.choice, SDM_DISTRIBUTION_SET_NORMAL);
    expect_ok(SHAPE_WITH("{a: uniform}"), "shape.distribution.b={mean: 0.1, deviation: 0.3}");
    assert_true(config.shape.n_distributions == 2 && distribution_of("b")->deviation == 0.3);
    static const char *const BOTH[] = {"shape.distribution=shape", "shape.distribution.b=uniform"};
    assert_int_equal(parse(SHAPE_WITH("normal"), BOTH, 2), SDM_OK);
    assert_int_equal(distribution_of("b")->choice, SDM_DISTRIBUTION_SET_UNIFORM);
}

static void test_distributions_are_dumped(void **state)
{
    (void)state;
    static const char *const TEXTS[] = {
        SHAPE_WITH("uniform"), SHAPE_WITH("normal"), BASE,
        SHAPE_WITH("{a: uniform, b: normal, c: {mean: 0.1, deviation: 1e-7}, d: shape}")};
    static const char *const LINES[] = {"\n  distribution: uniform\n", "\n  distribution: normal\n",
                                        "\n  distribution: shape\n",
                                        "\n  distribution: {\n    a: uniform,\n    b: normal,\n"
                                        "    c: {mean: 0.1, deviation: 1e-07},\n    d: shape}\n"};
    for (size_t i = 0; i < 4; i++) {
        sdm_text dump = {0}, again = {0};
        expect_ok(TEXTS[i], NULL);
        sdm_config_dump(&config, &dump);
        assert_non_null(strstr(dump.data, LINES[i]));
        expect_ok(dump.data, NULL);
        sdm_config_dump(&config, &again);
        assert_string_equal(dump.data, again.data);
        sdm_text_dispose(&dump);
        sdm_text_dispose(&again);
    }
}

static void test_distribution_mistakes(void **state)
{
    (void)state;
    expect_mistake(SHAPE_WITH("norml"), NULL,
                   "x.yaml:1:32: shape.distribution: 'norml' is not one of shape, uniform, normal; "
                   "did you mean 'normal'?");
    expect_mistake(SHAPE_WITH("[1, 2]"), NULL,
                   "x.yaml:1:32: shape.distribution: needs a name, or parameters with "
                   "distributions, got a list of 2");
    expect_mistake(
        SHAPE_WITH("{a: 3, B: normal, c: [1], d: {mean: 1}, e: {men: 1, deviation: 0}, f: }"), NULL,
        "x.yaml:1:36: shape.distribution.a: '3' is not one of shape, uniform, normal\n"
        "x.yaml:1:39: shape.distribution: 'B' is no name; use a-z, 0-9 and _, first a letter\n"
        "x.yaml:1:53: shape.distribution.c: needs uniform, normal, shape or {mean: x, deviation: "
        "y}, got a list of 1\n"
        "x.yaml:1:61: shape.distribution.d: missing key 'deviation'; e.g. {mean: 0, deviation: 1}\n"
        "x.yaml:1:76: shape.distribution.e: unknown key 'men'; did you mean 'mean'?\n"
        "x.yaml:1:95: shape.distribution.e.deviation: 0 is out of range (1e-09 .. 1000000000)\n"
        "x.yaml:1:102: shape.distribution.f: needs one of its names, got nothing");
    expect_mistake(SHAPE_WITH("uniform"), "shape.distribution.a=normal",
                   "argument 'shape.distribution.a=normal': shape.distribution: 'uniform' is set "
                   "for all parameters; give shape.distribution=shape before single ones");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_distributions),
        cmocka_unit_test(test_distributions_are_dumped),
        cmocka_unit_test(test_distribution_mistakes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
