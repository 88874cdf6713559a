/* Plug-ins in processes of their own: the same bits as in the program, and every end of the process
 * is an error with callback, parameters and reason. The test itself is the program of the workers.
 * Tests: isolated.c isolated_bytes.c isolated_memory.c isolated_process.c isolated_worker.c
 * callback.c crash_reason.c */
#include <errno.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

#include <cmocka.h>

#include "sdm/internal/isolation.h"
#include "sdm/internal/open_end.h"
#include "sdm/internal/sanitized.h"
#include "sdm/memory.h"

static sdm_error err;
static char notice[1024];
static int n_notices;

static void keep_notice(const char *text)
{
    snprintf(notice, sizeof notice, "%s", text);
    n_notices++;
}

static void err_has(const char *text)
{
    if (!strstr(err.text, text)) fail_msg("'%s' is not in '%s'", text, err.text);
}

static const sdm_isolation HOW = {
    .program = "/proc/self/exe", .seconds = 20, .bytes = 200000000, .notice = keep_notice};

/* A registry with the plug-in FOLDER/FILE; isolated unless `how` is NULL. */
static sdm_registry *open_plugin(const char *file, const sdm_isolation *how)
{
    char path[1024];
    sdm_registry *r = NULL;
    snprintf(path, sizeof path, "%s/%s", PLUGIN_FOLDER, file);
    assert_int_equal(sdm_registry_create(&r, &err), SDM_OK);
    if (how) assert_int_equal(sdm_registry_isolate(r, how, &err), SDM_OK);
    if (sdm_registry_load(r, path, &err)) fail_msg("%s", err.text);
    return r;
}

static sdm_instance *make(const sdm_registry *r, const char *name, const char *fault)
{
    sdm_instance *s = NULL;
    const sdm_named_text option = {"fault", fault};
    if (sdm_instance_create(sdm_registry_find(r, name, NULL), &option, fault != NULL, NULL, &s,
                            &err))
        fail_msg("%s", err.text);
    return s;
}

static void no_child_is_left(void)
{
    assert_int_equal(waitpid(-1, NULL, WNOHANG), -1);
    assert_int_equal(errno, ECHILD);
}

static void assert_same_mesh(const sdm_mesh *a, const sdm_mesh *b)
{
    assert_int_equal(a->n_vert, b->n_vert);
    assert_int_equal(a->n_tri, b->n_tri);
    assert_memory_equal(a->vert, b->vert, 3 * a->n_vert * sizeof *a->vert);
    assert_memory_equal(a->tri, b->tri, 3 * a->n_tri * sizeof *a->tri);
}

static void same_table(const sdm_shape *a, const sdm_shape *b)
{
    assert_string_equal(a->name, b->name);
    assert_string_equal(a->summary, b->summary);
    assert_int_equal(a->n_params, b->n_params);
    assert_int_equal(!a->velocity, !b->velocity);
    assert_int_equal(!a->distance, !b->distance);
    for (size_t i = 0; i < a->n_params; i++) {
        assert_string_equal(a->params[i].name, b->params[i].name);
        assert_string_equal(a->params[i].help, b->params[i].help);
        assert_true(a->params[i].min == b->params[i].min && a->params[i].max == b->params[i].max);
    }
    assert_int_equal(a->n_options, b->n_options);
    for (size_t i = 0; i < a->n_options; i++)
        if (a->options[i].choices)
            assert_string_equal(a->options[i].choices, b->options[i].choices);
}

static void results_have_the_same_bits(void **state)
{
    (void)state;
    sdm_registry *r[2] = {open_plugin("faulty/faulty.so", &HOW),
                          open_plugin("faulty/faulty.so", NULL)};
    sdm_instance *s[2] = {make(r[0], "faulty", "none"), make(r[1], "faulty", "none")};
    same_table(sdm_registry_at(r[0], 0), sdm_registry_at(r[1], 0));
    sdm_mesh mesh[2] = {{0}};
    for (int i = 0; i < 5; i++) {
        const double p[2] = {1 + 0.37 * i, 1.1 + 0.2 * i};
        double v[2][6 * 16];
        sdm_open_end end[2];
        for (int k = 0; k < 2; k++) {
            if (sdm_instance_mesh(s[k], p, &mesh[k], &err)) fail_msg("%s", err.text);
            if (sdm_instance_velocity(s[k], p, 16, v[k], &err)) fail_msg("%s", err.text);
            assert_true(sdm_instance_has_open_end(s[k]));
            if (sdm_instance_open_end(s[k], p, &end[k], &err)) fail_msg("%s", err.text);
        }
        assert_same_mesh(&mesh[0], &mesh[1]);
        assert_memory_equal(v[0], v[1], sizeof v[0]);
        assert_memory_equal(&end[0], &end[1], sizeof end[0]);
        assert_true(end[0].centre[1] == 0.3 * p[1] && end[0].radius == p[0] * p[1]);
    }
    for (int k = 0; k < 2; k++) {
        sdm_mesh_dispose(&mesh[k]);
        sdm_instance_free(s[k]);
        sdm_registry_free(r[k]);
    }
    no_child_is_left();
}

static void closed_forms_have_the_same_bits(void **state)
{
    (void)state;
    const double p[1] = {2}, x[3] = {1.7, -0.3, 2.9};
    double d[2];
    for (int k = 0; k < 2; k++) {
        sdm_registry *r = open_plugin("good/octahedron.so", k ? NULL : &HOW);
        sdm_instance *s = make(r, "octahedron", NULL);
        if (sdm_instance_distance(s, p, x, &d[k], &err)) fail_msg("%s", err.text);
        assert_false(sdm_instance_has_open_end(s));
        sdm_instance_free(s);
        sdm_registry_free(r);
    }
    assert_true(d[0] == d[1] && d[0] > 0);
}

/* Four threads at once, each with a worker of its own. */
static void threads_call_at_once(void **state)
{
    (void)state;
    sdm_registry *r = open_plugin("faulty/faulty.so", &HOW);
    sdm_instance *s = make(r, "faulty", "none");
    int bad = 0;
#pragma omp parallel for num_threads(4) reduction(+ : bad)
    for (int i = 0; i < 64; i++) {
        const double p[2] = {1 + i / 32.0, 1.5};
        sdm_mesh mesh = {0};
        bad += sdm_instance_mesh(s, p, &mesh, NULL) != SDM_OK || mesh.vert[0] != -p[0];
        sdm_mesh_dispose(&mesh);
    }
    assert_int_equal(bad, 0);
    sdm_instance_free(s);
    sdm_registry_free(r);
    no_child_is_left();
}

/* A fault at size 2.5 is an error, and size 1.5 works before and after it. */
static void fault(const char *name, const char *reason, const sdm_isolation *how)
{
    static const double GOOD[2] = {1.5, 1.5}, BAD[2] = {2.5, 1.5};
    sdm_registry *r = open_plugin("faulty/faulty.so", how);
    sdm_instance *s = make(r, "faulty", name);
    sdm_mesh mesh = {0};
    if (sdm_instance_mesh(s, GOOD, &mesh, &err)) fail_msg("%s: %s", name, err.text);
    if (sdm_instance_mesh(s, BAD, &mesh, &err) != SDM_E_PLUGIN) fail_msg("%s: no error", name);
    err_has("shape 'faulty' at size=2.5 reach=1.5: ");
    err_has(reason);
    if (sdm_instance_mesh(s, GOOD, &mesh, &err)) fail_msg("%s: %s", name, err.text);
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(s);
    sdm_registry_free(r);
    no_child_is_left();
}

static void every_end_is_an_error(void **state)
{
    (void)state;
    fault("fail", "too large", &HOW);
    fault("crash",
          SDM_SANITIZED ? "exit(1)"
                        : "faulty.so: mesh(): the plug-in used memory that is not its own",
          &HOW);
    fault("abort", "mesh(): the plug-in called abort()", &HOW);
    fault("exit", "mesh(): the plug-in called exit(0), which it must not", &HOW);
    fault("write", "mesh() changed the parameters", &HOW);
    sdm_isolation how = HOW;
    how.seconds = 1;
    fault("hang", "mesh(): the plug-in did not come to an end within 1 s", &how);
}

static void memory_faults_are_errors(void **state)
{
    (void)state;
    if (SDM_SANITIZED) skip(); // sanitizers find these, and there is no limit of memory
    fault("flood", "mesh(): the plug-in needs more than 0.2 GB of memory", &HOW);
    fault("heap", "mesh(): the plug-in called abort(), or damaged memory; it printed: ", &HOW);
    fault("beyond", "mesh(): it has written or read beyond the 16 vertices that it reserved", &HOW);
    fault("before", "mesh() wrote outside of the arrays of reserve()", &HOW);
}

/* After three calls that hang an instance is not called again. */
static void a_shape_that_hangs_is_given_up(void **state)
{
    (void)state;
    sdm_isolation how = HOW;
    how.seconds = 0.3;
    sdm_registry *r = open_plugin("faulty/faulty.so", &how);
    sdm_instance *s = make(r, "faulty", "hang");
    sdm_mesh mesh = {0};
    const double p[2] = {2.5, 1.5}, good[2] = {1.5, 1.5};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(sdm_instance_mesh(s, p, &mesh, &err), SDM_E_PLUGIN);
        err_has("within 0.3 s");
    }
    assert_int_equal(sdm_instance_mesh(s, good, &mesh, &err), SDM_E_PLUGIN);
    err_has("not called again");
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(s);
    sdm_registry_free(r);
    no_child_is_left();
}

static void what_a_plugin_prints_is_told_once(void **state)
{
    (void)state;
    sdm_registry *r = open_plugin("faulty/faulty.so", &HOW);
    sdm_instance *s = make(r, "faulty", "print");
    sdm_mesh mesh = {0};
    const double p[2] = {2.5, 1.5};
    n_notices = 0;
    for (int i = 0; i < 3; i++)
        if (sdm_instance_mesh(s, p, &mesh, &err)) fail_msg("%s", err.text);
    assert_int_equal(n_notices, 1);
    assert_non_null(strstr(notice, "faulty.so prints: a line for the user"));
    sdm_mesh_dispose(&mesh);
    sdm_instance_free(s);
    sdm_registry_free(r);
}

static void bad_files_and_arguments_are_refused(void **state)
{
    (void)state;
    sdm_registry *r = NULL;
    sdm_isolation how = HOW;
    assert_int_equal(sdm_registry_create(&r, &err), SDM_OK);
    assert_int_equal(sdm_registry_isolate(NULL, &how, &err), SDM_E_ARG);
    how.seconds = 0;
    assert_int_equal(sdm_registry_isolate(r, &how, &err), SDM_E_ARG);
    how = HOW;
    assert_int_equal(sdm_registry_isolate(r, &how, &err), SDM_OK);
    assert_int_equal(sdm_registry_load(r, PLUGIN_FOLDER "/wrong_abi/plugin.so", &err),
                     SDM_E_PLUGIN);
    err_has("this program has interface 1");
    assert_int_equal(sdm_registry_load(r, PLUGIN_FOLDER "/no_symbol/plugin.so", &err),
                     SDM_E_PLUGIN);
    err_has("exports no function");
    assert_int_equal(sdm_registry_load(r, PLUGIN_FOLDER "/second_bad/plugin.so", &err),
                     SDM_E_PLUGIN);
    assert_int_equal(sdm_registry_count(r), 0);
    how.program = "/nowhere/sdmgen";
    assert_int_equal(sdm_registry_isolate(r, &how, &err), SDM_OK);
    assert_int_equal(sdm_registry_load(r, PLUGIN_FOLDER "/good/octahedron.so", &err), SDM_E_IO);
    err_has("no process for it (/nowhere/sdmgen)");
    // a program that is no worker
    how.program = "/bin/false";
    assert_int_equal(sdm_registry_isolate(r, &how, &err), SDM_OK);
    assert_int_equal(sdm_registry_load(r, PLUGIN_FOLDER "/good/octahedron.so", &err), SDM_E_PLUGIN);
    sdm_registry_free(r);
    no_child_is_left();
}

int main(int argc, char **argv)
{
    if (argc > 1 && !strcmp(argv[1], SDM_ISOLATION_COMMAND))
        return sdm_isolation_worker(argc - 1, argv + 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(results_have_the_same_bits),
        cmocka_unit_test(closed_forms_have_the_same_bits),
        cmocka_unit_test(threads_call_at_once),
        cmocka_unit_test(every_end_is_an_error),
        cmocka_unit_test(memory_faults_are_errors),
        cmocka_unit_test(a_shape_that_hangs_is_given_up),
        cmocka_unit_test(what_a_plugin_prints_is_told_once),
        cmocka_unit_test(bad_files_and_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
