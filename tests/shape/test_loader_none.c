/* The loader of a build without shared objects: plug-ins are refused with advice, and built-in
 * shapes still work.
 * Tests: loader_none.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(plugins_are_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
