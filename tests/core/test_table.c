/* Tables: Markdown and CSV cells, and a whole table written to a file.
 * Tests: table.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/file.h"
#include "sdm/internal/table.h"
#include "sdm/memory.h"

/* Asserts that the text equals `wanted`, then empties it. */
static void text_check(sdm_text *t, const char *wanted)
{
    assert_false(t->failed);
    assert_string_equal(t->data, wanted);
    sdm_text_dispose(t);
}

static void markdown_cells_are_escaped(void **state)
{
    (void)state;
    sdm_text t = {0};
    sdm_markdown_text(&t, "a|b*_`<\\[c]");
    text_check(&t, "a\\|b\\*\\_\\`\\<\\\\\\[c]");
    sdm_markdown_rule(&t, 2, 1);
    text_check(&t, "|---|---|---:|\n");
    const double values[] = {0, 7, 99.75, 0.012345, 1234.5, 2e6, 9e-4, NAN, -INFINITY};
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) sdm_markdown_plain(&t, values[i]);
    text_check(&t, " 0 | 7 | 99.8 | 0.0123 | 1234 | 2.00e+06 | 9.00e-04 | - | - |");
    for (size_t i = 0; i < sizeof values / sizeof *values; i++) sdm_markdown_real(&t, values[i]);
    text_check(&t, " 0 | 7 | 99.8 | 0.0123 | 1.23e+03 | 2e+06 | 0.0009 | - | - |");
}

static void csv_cells_are_quoted(void **state)
{
    (void)state;
    sdm_text t = {0};
    sdm_csv_text(&t, "a \"b\", c");
    sdm_csv_real(&t, 0.1);
    sdm_csv_real(&t, NAN);
    sdm_csv_real(&t, 1e300);
    text_check(&t, "\"a \"\"b\"\", c\",0.1,,1e+300");
}

static void table_is_written_to_a_file(void **state)
{
    (void)state;
    sdm_text t = {0};
    sdm_error err = {0};
    uint8_t *data = NULL;
    size_t size = 0;
    sdm_csv_text(&t, "x");
    assert_int_equal(sdm_text_write(&t, "table.csv", &err), SDM_OK);
    assert_int_equal(sdm_file_read("table.csv", 100, &data, &size, &err), SDM_OK);
    assert_string_equal((char *)data, "\"x\"");
    sdm_free(data);
    assert_int_equal(sdm_text_write(&t, "missing/table.csv", &err), SDM_E_IO);
    t.failed = true;
    assert_int_equal(sdm_text_write(&t, "never.csv", &err), SDM_E_NOMEM);
    assert_null(fopen("never.csv", "r"));
    sdm_text_dispose(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(markdown_cells_are_escaped),
                                       cmocka_unit_test(csv_cells_are_quoted),
                                       cmocka_unit_test(table_is_written_to_a_file)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
