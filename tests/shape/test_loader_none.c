/* The loader of a build without shared objects: plug-ins are refused with advice, nothing is
 * isolated, and built-in shapes still work.
 * Tests: loader_none.c isolated_none.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/internal/isolation.h"
#include "sdm/registry.h"

static void plugins_are_refused(void **state)
{
    (void)state;
    sdm_error err = {0};
    sdm_registry *r;
    assert_int_equal(sdm_registry_create(&r, &err), SDM_OK);
    assert_int_equal(sdm_registry_load(r, "a.so", &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, "a.so"));
    assert_non_null(strstr(err.text, "sdm_registry_add()"));
    assert_int_equal(sdm_registry_load_path(r, "folder", &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, "folder"));
    assert_int_equal(sdm_registry_load_path(r, NULL, &err), SDM_OK);
    assert_int_equal(sdm_registry_load_path(r, "", &err), SDM_OK);
    assert_int_equal(sdm_registry_load(NULL, "a.so", &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_load(r, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_load_path(NULL, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_builtin_shapes_add(r, &err), SDM_OK);
    assert_true(sdm_registry_count(r) > 0);
    sdm_registry_free(r);
}

static void nothing_is_isolated(void **state)
{
    (void)state;
    sdm_error err = {0};
    sdm_registry *r;
    const sdm_isolation how = {.program = "/proc/self/exe", .seconds = 1, .bytes = 1000000};
    assert_int_equal(sdm_registry_create(&r, &err), SDM_OK);
    assert_int_equal(sdm_registry_isolate(r, &how, &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(err.text, "SDM_PLUGINS=ON"));
    assert_int_equal(sdm_isolation_worker(0, NULL), 1);
    sdm_registry_free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(plugins_are_refused),
                                       cmocka_unit_test(nothing_is_isolated)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
