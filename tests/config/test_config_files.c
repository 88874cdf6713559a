/* Configuration: the shipped files are valid, and the documentation lists exactly the keys of the
 * program.
 * Tests: config_describe.c */
#include <glob.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/config.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

static sdm_config config; /* too large for some stacks */
static sdm_error err;

static char *read_source(const char *name)
{
    char path[2048];
    uint8_t *data = NULL;
    size_t size = 0;
    snprintf(path, sizeof path, "%s/%s", SDM_SOURCE_FOLDER, name);
    if (sdm_file_read(path, 1 << 20, &data, &size, &err)) fail_msg("%s", err.text);
    return (char *)data;
}

/* Returns the text between the lines `begin` and `end`; ends it in place with a zero byte. */
static char *between(char *text, const char *begin, const char *end)
{
    char *from = strstr(text, begin), *to = from ? strstr(from + strlen(begin), end) : NULL;
    if (!to) fail_msg("no part from %s to %s", begin, end);
    *to = 0;
    return from + strlen(begin);
}

static void test_documented_keys(void **state)
{
    sdm_text table = {0};
    char *page = read_source("docs/configuration.md");
    (void)state;
    sdm_config_describe(true, &table);
    assert_false(table.failed);
    // When this fails, replace the text between the two marks by the output of `sdmgen config
    // --keys --markdown`.
    assert_string_equal(between(page, "<!-- keys: begin -->\n", "<!-- keys: end -->"), table.data);
    sdm_text_dispose(&table);
    sdm_free(page);
}

static void test_documented_example(void **state)
{
    char *page = read_source("docs/configuration.md");
    (void)state;
    const char *example = between(page, "```yaml\n", "```");
    if (sdm_config_parse("example", example, strlen(example), NULL, 0, &config, &err))
        fail_msg("%s", err.text);
    assert_string_equal(config.shape.name, "ellipsoid");
    sdm_free(page);
}

/* The table of keys as plain text and as Markdown: one line for each key below the head; the
 * plain form has aligned columns. */
static void test_plain_and_markdown_tables(void **state)
{
    sdm_text plain = {0}, table = {0};
    size_t keys = 0, column = 0;
    (void)state;
    sdm_config_describe(false, &plain);
    sdm_config_describe(true, &table);
    assert_false(plain.failed || table.failed);
    for (const char *p = table.data; (p = strstr(p, "\n| `")); p++) keys++;
    assert_true(keys > 40);

    size_t lines = 0;
    column = (size_t)(strstr(plain.data, "Type") - plain.data);
    for (const char *line = plain.data; *line; line = strchr(line, '\n') + 1, lines++) {
        assert_true(line[column] != ' ');
        assert_memory_equal(line + column - 2, "  ", 2);
    }
    assert_int_equal(lines, keys + 1);
    sdm_text_dispose(&plain);
    sdm_text_dispose(&table);
}

/* configs/cochlea.yaml, the template for users, has every key, active or commented out. */
static void test_complete_template(void **state)
{
    sdm_text table = {0};
    char *template = read_source("configs/cochlea.yaml");
    (void)state;
    sdm_config_describe(true, &table);
    for (char *p = table.data; (p = strstr(p, "\n| `"));) {
        char key[96], commented[100];
        p += strlen("\n| `");
        const size_t length = strcspn(p, "`");
        const char *dot = memchr(p, '.', length), *name = dot ? dot + 1 : p;
        snprintf(key, sizeof key, "\n%s%.*s:", dot ? "  " : "", (int)(length - (size_t)(name - p)),
                 name);
        snprintf(commented, sizeof commented, "\n  # %s", key + (dot ? 3 : 1));
        if (!strstr(template, key) && !strstr(template, commented)) fail_msg("no line for%s", key);
    }
    sdm_text_dispose(&table);
    sdm_free(template);
}

static void test_shipped_files(void **state)
{
    glob_t found;
    (void)state;
    assert_int_equal(glob(SDM_SOURCE_FOLDER "/configs/*.yaml", 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++) {
        char *text = read_source(found.gl_pathv[i] + strlen(SDM_SOURCE_FOLDER) + 1);
        const bool is_experiment = strstr(text, "\nmethods:") != NULL;
        sdm_free(text);
        if (is_experiment) continue; /* read by test_experiment */
        if (sdm_config_read(found.gl_pathv[i], NULL, 0, &config, &err)) fail_msg("%s", err.text);
        assert_memory_equal(config.output.folder, "runs/", 5);
    }
    assert_true(found.gl_pathc >= 3);
    globfree(&found);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_documented_keys),
        cmocka_unit_test(test_documented_example),
        cmocka_unit_test(test_plain_and_markdown_tables),
        cmocka_unit_test(test_complete_template),
        cmocka_unit_test(test_shipped_files),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
