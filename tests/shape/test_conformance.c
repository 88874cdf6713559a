/* The tests of shapes: each finds the fault that is made for it, and none finds a fault in a sound
 * shape. The test itself is the program of the workers.
 * Tests: conformance.c mesh_checksum.c shape_beside.c shape_other_option.c shape_repeat.c
 * stack_fill.c isolated.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/internal/conformance.h"
#include "sdm/internal/isolation.h"

static sdm_error err;
static sdm_conformance found;
static sdm_registry *registry; // with the plug-in unfit, isolated

static const char *outcome_name(sdm_test_outcome o)
{
    static const char *const names[] = {"passed", "skipped", "doubtful", "failed"};
    return names[o];
}

static void make(const char *shape)
{
    const sdm_conformance_opts opts = {.samples = 8, .seed = 3, .n_threads = 2};
    sdm_instance *s = NULL;
    if (sdm_instance_create(sdm_registry_find(registry, shape, NULL), NULL, 0, NULL, &s, &err))
        fail_msg("%s", err.text);
    if (sdm_conformance_make(s, &opts, &found, &err)) fail_msg("%s: %s", shape, err.text);
    sdm_instance_free(s);
}

static void has(int test, sdm_test_outcome outcome, const char *text)
{
    const sdm_test_result *r = &found.test[test];
    if (r->outcome != outcome || !strstr(r->text, text))
        fail_msg("%s: %s: %s; need %s: %s", r->name, outcome_name(r->outcome), r->text,
                 outcome_name(outcome), text);
}

/* Of the tests, `test` alone is not passed or skipped. */
static void only(int test)
{
    for (int i = 0; i < SDM_N_TESTS; i++) {
        const sdm_test_result *r = &found.test[i];
        if (i != test && r->outcome > SDM_TEST_SKIPPED)
            fail_msg("%s: %s: %s", r->name, outcome_name(r->outcome), r->text);
    }
}

static void a_sound_shape_passes(void **state)
{
    (void)state;
    make("unfit_none");
    only(-1);
    has(SDM_TEST_MESHES, SDM_TEST_PASSED, "13 meshes, the first with 16 vertices");
    has(SDM_TEST_THREADS, SDM_TEST_PASSED, "same bits");
    has(SDM_TEST_OUTSIDE, SDM_TEST_PASSED, "8 calls");
    has(SDM_TEST_OPTIONS, SDM_TEST_SKIPPED, "");
    assert_int_equal(sdm_conformance_verdict(&found), SDM_OK);
}

/* A shape of the program: nothing is called outside its ranges. */
static void a_builtin_shape_passes(void **state)
{
    (void)state;
    make("torus");
    only(-1);
    has(SDM_TEST_OUTSIDE, SDM_TEST_SKIPPED, "no plug-in");
    has(SDM_TEST_OPTIONS, SDM_TEST_PASSED, "mesh at the ends");
}

static void meshes_that_fail(void **state)
{
    (void)state;
    make("unfit_fail");
    has(SDM_TEST_MESHES, SDM_TEST_FAILED, "meshes cannot be made: too large");
    assert_true(found.test[SDM_TEST_MESHES].has_params);
    assert_true(found.test[SDM_TEST_MESHES].p[0] > 2);
    only(SDM_TEST_MESHES);
    assert_int_equal(sdm_conformance_verdict(&found), SDM_E_MESH);
}

static void meshes_with_faults(void **state)
{
    (void)state;
    make("unfit_open");
    has(SDM_TEST_CLOSED, SDM_TEST_FAILED, "in 13 of 13 shapes, up to 3");
    only(SDM_TEST_CLOSED);
    assert_int_equal(sdm_conformance_verdict(&found), SDM_E_MESH);
    make("unfit_handle");
    has(SDM_TEST_ORIENTED, SDM_TEST_FAILED, "parts are inside out in 13 of 13 shapes, up to 1");
    only(SDM_TEST_ORIENTED);
    assert_int_equal(sdm_conformance_verdict(&found), SDM_E_QUALITY);
}

static void meshes_that_change(void **state)
{
    (void)state;
    make("unfit_sizes"); // also wrong velocities, of the vertices that come and go
    has(SDM_TEST_TRIANGLES, SDM_TEST_FAILED, "other numbers of vertices or triangles");
    make("unfit_wires");
    has(SDM_TEST_TRIANGLES, SDM_TEST_FAILED, "the triangles have other vertices");
    only(SDM_TEST_TRIANGLES);
    make("unfit_jump");
    has(SDM_TEST_CONTINUOUS, SDM_TEST_FAILED, "jumps by 0.125 mm along size");
    assert_true(found.test[SDM_TEST_CONTINUOUS].p[0] > 1.999);
    assert_true(found.test[SDM_TEST_CONTINUOUS].p[0] < 2.001);
    only(SDM_TEST_CONTINUOUS);
    make("unfit_velocity");
    has(SDM_TEST_VELOCITY, SDM_TEST_FAILED, "off by 0.0099 of the largest velocity by reach");
    only(SDM_TEST_VELOCITY);
}

static void calls_that_differ(void **state)
{
    (void)state;
    make("unfit_unlike");
    has(SDM_TEST_REPEATS, SDM_TEST_FAILED,
        "8 of 8 meshes have other bits when they are made again");
    has(SDM_TEST_THREADS, SDM_TEST_FAILED, "other bits");
    // a parameter that decides is named
    make("unfit_cache");
    has(SDM_TEST_REPEATS, SDM_TEST_FAILED, "after a call in which only 'reach' differs");
    assert_true(found.test[SDM_TEST_REPEATS].has_params);
    // and an option
    make("sided");
    has(SDM_TEST_REPEATS, SDM_TEST_FAILED, "another value of the option 'side'");
    only(SDM_TEST_REPEATS);
    // what looks like a jump is none if it depends on the calls before
    make("unfit_lapse");
    has(SDM_TEST_REPEATS, SDM_TEST_FAILED, "beside this value of size have other bits");
    assert_true(found.test[SDM_TEST_REPEATS].p[0] > 2.14);
    assert_true(found.test[SDM_TEST_REPEATS].p[0] < 2.31);
    has(SDM_TEST_CONTINUOUS, SDM_TEST_SKIPPED, "depend on the calls before");
    make("unfit_shared");
    has(SDM_TEST_REPEATS, SDM_TEST_PASSED, "same bits");
    has(SDM_TEST_THREADS, SDM_TEST_FAILED, "when they are made by several threads at once");
    only(SDM_TEST_THREADS);
    assert_int_equal(sdm_conformance_verdict(&found), SDM_E_QUALITY);
}

static void calls_that_crash(void **state)
{
    (void)state;
    make("unfit_edge");
    has(SDM_TEST_OUTSIDE, SDM_TEST_DOUBTFUL, "mesh(): the plug-in called abort()");
    assert_true(found.test[SDM_TEST_OUTSIDE].p[0] != found.test[SDM_TEST_OUTSIDE].p[0]);
    only(SDM_TEST_OUTSIDE);
    assert_int_equal(sdm_conformance_verdict(&found), SDM_OK);
    make("picky");
    has(SDM_TEST_OPTIONS, SDM_TEST_FAILED, "with mode=abort: ");
    assert_int_equal(found.test[SDM_TEST_OPTIONS].figure, 1);
    only(SDM_TEST_OPTIONS);
}

/* A part in metres beside one in millimetres. */
static void a_part_in_metres(void **state)
{
    (void)state;
    make("unfit_small");
    has(SDM_TEST_UNITS, SDM_TEST_DOUBTFUL, "times smaller than another one in 13 of 13 shapes");
    // the speed by `reach` of the vertices in metres, 1000 times less than in millimetres
    has(SDM_TEST_UNITS, SDM_TEST_DOUBTFUL,
        "1 mm of the parameter 'reach' moves no vertex of part 2 of 2 by more than 0.001 mm, and "
        "no "
        "other part: are the vertices of part 2 of 2 in m? Multiply them by 1000");
    assert_true(found.test[SDM_TEST_UNITS].has_params);
}

/* Options that exclude each other: an error with a reason. */
static void options_that_are_refused(void **state)
{
    (void)state;
    make("cochlea");
    has(SDM_TEST_OPTIONS, SDM_TEST_DOUBTFUL, "with radius=0.1: tube radius");
    assert_int_equal(sdm_conformance_verdict(&found), SDM_OK);
}

static bool now(void *user)
{
    (void)user;
    return true;
}

static void interrupted_tests_end(void **state)
{
    (void)state;
    const sdm_conformance_opts opts = {.samples = 8, .cancelled = now};
    sdm_instance *s = NULL;
    assert_int_equal(
        sdm_instance_create(sdm_registry_find(registry, "torus", NULL), NULL, 0, NULL, &s, &err),
        SDM_OK);
    assert_int_equal(sdm_conformance_make(s, &opts, &found, &err), SDM_E_CANCELLED);
    sdm_instance_free(s);
}

static int open_registry(void **state)
{
    (void)state;
    const sdm_isolation how = {.program = "/proc/self/exe", .seconds = 30, .bytes = 1000000000};
    return sdm_registry_create(&registry, &err) || sdm_builtin_shapes_add(registry, &err) ||
           sdm_registry_isolate(registry, &how, &err) ||
           sdm_registry_load(registry, PLUGIN_FOLDER "/unfit/unfit.so", &err);
}

static int close_registry(void **state)
{
    (void)state;
    sdm_registry_free(registry);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc > 1 && !strcmp(argv[1], SDM_ISOLATION_COMMAND))
        return sdm_isolation_worker(argc - 1, argv + 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sound_shape_passes),  cmocka_unit_test(a_builtin_shape_passes),
        cmocka_unit_test(meshes_that_fail),      cmocka_unit_test(meshes_with_faults),
        cmocka_unit_test(meshes_that_change),    cmocka_unit_test(calls_that_differ),
        cmocka_unit_test(calls_that_crash),      cmocka_unit_test(options_that_are_refused),
        cmocka_unit_test(interrupted_tests_end), cmocka_unit_test(a_part_in_metres),
    };
    return cmocka_run_group_tests(tests, open_registry, close_registry);
}
