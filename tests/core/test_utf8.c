/* Lengths of UTF-8 characters, and what is shown of texts that command a terminal.
 * Tests: json.c utf8.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/utf8.h"

/* Every sequence of up to four bytes that this encoder makes is a character, its beginnings are
 * none. */
static void all_characters(void **state)
{
    (void)state;
    for (uint32_t c = 1; c <= 0x10FFFF; c++) {
        char s[5] = {0};
        size_t n = 1;
        if (c < 0x80) {
            s[0] = (char)c;
        } else {
            n = c < 0x800 ? 2 : c < 0x10000 ? 3 : 4;
            for (size_t i = n - 1; i > 0; i--) s[i] = (char)(0x80 | (c >> 6 * (n - 1 - i) & 0x3F));
            s[0] = (char)((0xF00 >> n & 0xFF) | c >> 6 * (n - 1));
        }
        const size_t wanted = c >= 0xD800 && c <= 0xDFFF ? 0 : n;
        if (sdm_utf8_length(s) != wanted) fail_msg("U+%04X: %zu", (unsigned)c, sdm_utf8_length(s));
        s[n - 1] = '\0';
        if (n > 1) assert_int_equal(sdm_utf8_length(s), 0);
    }
}

static void what_is_no_character(void **state)
{
    (void)state;
    static const char *const bad[] = {"\x80",
                                      "\xBF",
                                      "\xC0\x80",
                                      "\xC1\xBF",
                                      "\xE0\x9F\xBF",
                                      "\xED\xA0\x80",
                                      "\xF0\x8F\xBF\xBF",
                                      "\xF4\x90\x80\x80",
                                      "\xF5\x80\x80\x80",
                                      "\xFF",
                                      "\xC3z",
                                      "\xE2\x82z"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++)
        assert_int_equal(sdm_utf8_length(bad[i]), 0);
}

static void assert_shown(const char *text, const char *shown)
{
    sdm_text t = {0};
    sdm_text_add(&t, "%s", "");
    sdm_text_add_shown(&t, text);
    assert_false(t.failed);
    assert_string_equal(t.data, shown);
    sdm_text_dispose(&t);
}

static void what_commands_a_terminal_is_escaped(void **state)
{
    (void)state;
    assert_shown("plain: line\n\tand tab", "plain: line\n\tand tab");
    assert_shown("\xC3\xA4 \xE2\x82\xAC \xF0\x9F\x98\x80",
                 "\xC3\xA4 \xE2\x82\xAC \xF0\x9F\x98\x80");
    assert_shown("\x1B]0;title\x07 \x1B[2J\r\x7F", "\\x1B]0;title\\x07 \\x1B[2J\\x0D\\x7F");
    assert_shown("\xC2\x9B"
                 "31m",
                 "\\xC2\\x9B31m");
    assert_shown("st\xF6pped \xC3", "st\\xF6pped \\xC3");
    assert_shown("a\xE2\x80\xAE"
                 "b\xE2\x81\xA6",
                 "a\\xE2\\x80\\xAEb\\xE2\\x81\\xA6");
    assert_shown("\xE2\x80\x93 \xE2\x81\xAA", "\xE2\x80\x93 \xE2\x81\xAA");
}

static void json_is_utf8(void **state)
{
    (void)state;
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "\xFF", "a\xF6\x1B\x7F\xC3\xA4\xE2\x82");
    sdm_json_close(&j, '}');
    assert_string_equal(j.text.data, "{\"\xEF\xBF\xBD\": \"a\xEF\xBF\xBD\\u001b\\u007f\xC3\xA4"
                                     "\xEF\xBF\xBD\xEF\xBF\xBD\"}");
    sdm_json_dispose(&j);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_characters), cmocka_unit_test(what_is_no_character),
        cmocka_unit_test(what_commands_a_terminal_is_escaped), cmocka_unit_test(json_is_utf8)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
