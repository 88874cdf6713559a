/* A registry of the built-in shapes for the tests of one program (included): set_up() and
 * tear_down() are for cmocka_run_group_tests(). */
#pragma once

#include "sdm/builtin_shapes.h"

static sdm_registry *registry;

static int set_up(void **state)
{
    (void)state;
    return sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL);
}

static int tear_down(void **state)
{
    (void)state;
    sdm_registry_free(registry);
    return 0;
}
