/* SHA-256 against the examples of NIST for FIPS 180-4 and against lengths around the padding.
 * Tests: sha256.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/sha256.h"

static void examples_of_the_standard(void **state)
{
    (void)state;
    static const struct {
        const char *text, *hash;
    } known[] = {
        {"", "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"},
        {"abc", "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"},
        {"abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq",
         "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1"},
        {"abcdefghbcdefghicdefghijdefghijkefghijklfghijklmghijklmnhijklmnoijklmnopjklmnopqklmnopqrl"
         "mnopqrsmnopqrstnopqrstu",
         "cf5b16a778af8380036ce59e7b0492370b249b11e8f07a51afac45037afee9d1"}};
    char text[SDM_SHA256_TEXT];
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        assert_string_equal(sdm_sha256(known[i].text, strlen(known[i].text), text), known[i].hash);
}

static void a_million_letters(void **state)
{
    (void)state;
    enum { N = 1000000 };
    char text[SDM_SHA256_TEXT], *a = malloc(N);
    assert_non_null(a);
    memset(a, 'a', N);
    assert_string_equal(sdm_sha256(a, N, text),
                        "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
    free(a);
}

/* The hash of the hashes of 0 to 199 bytes 0, 1, 2 ...; the number is that of Python's hashlib. */
static void lengths_around_the_padding(void **state)
{
    (void)state;
    enum { N = 200 };
    static char all[N * (SDM_SHA256_TEXT - 1) + 1];
    uint8_t bytes[N];
    char text[SDM_SHA256_TEXT];
    for (size_t n = 0; n < N; n++) {
        bytes[n] = (uint8_t)n;
        strcat(all, sdm_sha256(bytes, n, text));
    }
    assert_string_equal(sdm_sha256(all, strlen(all), text),
                        "7a38a844c9e159de39f0862ee2e28569a8250831150a3fbf0a59c001129b2fb2");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(examples_of_the_standard),
                                       cmocka_unit_test(a_million_letters),
                                       cmocka_unit_test(lengths_around_the_padding)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
