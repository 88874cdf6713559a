/* Which tests of a program run: the environment variables SDM_ONLY and SDM_WITHOUT hold a pattern
 * of names, with * and ?. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

__attribute__((constructor)) static void choose_tests(void)
{
    const char *only = getenv("SDM_ONLY"), *without = getenv("SDM_WITHOUT");
    if (only) cmocka_set_test_filter(only);
    if (without) cmocka_set_skip_filter(without);
}
