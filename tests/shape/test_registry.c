/* The registry of shapes: what it refuses at registration, options given as text, and checks around
 * every callback.
 * Tests: host.c instance.c options.c registry.c shape_check.c velocity.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/skipped.h"

static sdm_error err;

static void err_has(const char *text)
{
    if (!strstr(err.text, text)) fail_msg("'%s' is not in '%s'", text, err.text);
}

/* A tetrahedron; its options select good or faulty behaviour. Every test starts from this table
 * of callbacks. */
static const sdm_param PARAMS[] = {{"size", "mm", 1, 3, 2, "edge"},
                                   {"shift", "mm", -1, 1, 0, "along x"}};

enum { MODE, LEVEL, COUNT, DATA, N_OPTIONS };

static const sdm_option OPTIONS[N_OPTIONS] = {
    [MODE] = {"mode", SDM_OPTION_CHOICE, "", 0, 0, 0,
              "good|nan|infinite|index|empty|error|mute|resize|swap|skip|memory|file|huge|lazy|"
              "vertex|triangle",
              "x"},
    [LEVEL] = {"level", SDM_OPTION_REAL, "mm", -1, 1.5, 0.25, NULL, "x"},
    [COUNT] = {"count", SDM_OPTION_INT, "", 1, 10, 4, NULL, "x"},
    [DATA] = {"data", SDM_OPTION_FILE, "", 0, 0, 0, NULL, "x"},
};

static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out)
{
    (void)self;
    const char *mode = options[MODE].text;
    // In parentheses: cmocka defines a macro fail().
    if (!strcmp(mode, "error")) return (host->fail)(host, "the size is unlucky");
    if (!strcmp(mode, "mute")) return 7;
    if (!strcmp(mode, "skip")) return 0;
    if (!strcmp(mode, "huge")) return host->reserve(host, out, (size_t)1 << 40, 4);
    if (!strcmp(mode, "file")) {
        const unsigned char *data;
        size_t size;
        return host->read_file(host, "/dev/null", &data, &size);
    }
    if (!strcmp(mode, "memory")) sdm_alloc_fail_after(1);
    const int failed = host->reserve(host, out, 4, !strcmp(mode, "empty") ? 0 : 4);
    sdm_alloc_fail_after(0);
    if (failed) return failed;
    static const uint32_t TRI[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    for (int i = 0; i < 12; i++) out->vert[i] = 0;
    for (int k = 0; k < 3; k++) out->vert[3 * (k + 1) + k] = p[0];
    for (int i = 0; i < 4; i++) out->vert[3 * i] += p[1] * p[1];
    if (out->n_tri) memcpy(out->tri, TRI, strcmp(mode, "lazy") ? sizeof TRI : sizeof TRI / 2);
    if (!strcmp(mode, "nan")) out->vert[7] = NAN;
    if (!strcmp(mode, "infinite")) out->vert[3] = INFINITY;
    if (!strcmp(mode, "index")) out->tri[10] = 4;
    double *volatile vert = out->vert; // so that the compiler does not know where it ends
    uint32_t *volatile tri = out->tri;
    if (!strcmp(mode, "vertex")) vert[12] = vert[13] = vert[14] = 0;
    if (!strcmp(mode, "triangle")) tri[14] = 0;
    if (!strcmp(mode, "resize")) out->n_vert = 5;
    if (!strcmp(mode, "swap")) {
        static double other[12];
        out->vert = other;
    }
    return 0;
}

static int distance(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, const double x[3], double *out)
{
    (void)self, (void)p, (void)host;
    *out = !strcmp(options[MODE].text, "nan") ? NAN : x[0];
    return 0;
}

static int velocity(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, size_t n_vert, double *out)
{
    (void)self, (void)p, (void)host;
    for (size_t i = 0; i < 6 * n_vert; i++) out[i] = 1;
    if (!strcmp(options[MODE].text, "nan")) out[4 * 3 + 5] = NAN;
    return 0;
}

static const sdm_shape GOOD = {.abi = SDM_SHAPE_ABI,
                               .size = sizeof(sdm_shape),
                               .name = "tetra",
                               .summary = "test",
                               .params = PARAMS,
                               .n_params = 2,
                               .options = OPTIONS,
                               .n_options = N_OPTIONS,
                               .mesh = mesh,
                               .distance = distance};

static sdm_registry *registry;

static int set_up(void **state)
{
    (void)state;
    return sdm_registry_create(&registry, NULL) != SDM_OK;
}

static int tear_down(void **state)
{
    (void)state;
    sdm_registry_free(registry);
    return 0;
}

static void registration_refused(const sdm_shape *shape, const char *text)
{
    assert_int_equal(sdm_registry_add(registry, shape, "there", &err), SDM_E_PLUGIN);
    err_has(text);
    assert_memory_equal(err.text, "there: ", 7);
    assert_int_equal(sdm_registry_count(registry), 0);
}

static void test_names_are_checked(void **state)
{
    (void)state;
    static const char *const BAD[] = {
        "",         "Tetra", "1st",
        "_x",       "a-b",   "a b",
        "\xc3\xa9", NULL,    "a23456789012345678901234567890123456789012345678901234567890abcd"};
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        sdm_shape s = GOOD;
        s.name = BAD[i];
        registration_refused(&s, "there: shape of the name '");
        sdm_param params[2] = {PARAMS[0], PARAMS[1]};
        params[1].name = BAD[i];
        s = GOOD;
        s.params = params;
        registration_refused(&s, BAD[i] ? "there: shape 'tetra': parameter 2 has the name '"
                                        : "there: shape 'tetra': parameter 2 has no name: a row");
        sdm_option options[N_OPTIONS];
        memcpy(options, OPTIONS, sizeof options);
        options[2].name = BAD[i];
        s = GOOD;
        s.options = options;
        registration_refused(&s, "there: shape 'tetra': option 3 has the name '");
    }
    sdm_shape s = GOOD;
    s.name = "a_1"; // the shortest and the longest valid names
    assert_int_equal(sdm_registry_add(registry, &s, "there", &err), SDM_OK);
    s.name = "a23456789012345678901234567890123456789012345678901234567890abc";
    assert_int_equal(sdm_registry_add(registry, &s, "there", &err), SDM_OK);
}

static void test_parameters_are_checked(void **state)
{
    (void)state;
    static const struct {
        double min, max, def;
        const char *text;
    } BAD[] = {{1, 1, 1, "range 1 .. 1"},
               {2, 1, 1.5, "range 2 .. 1"},
               {NAN, 1, 1, "finite"},
               {0, INFINITY, 1, "finite"},
               {0, 1, 1.5, "default 1.5 outside"},
               {0, 1, NAN, "default nan outside"}};
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        sdm_param params[2] = {PARAMS[0], {"b", "mm", BAD[i].min, BAD[i].max, BAD[i].def, ""}};
        sdm_shape s = GOOD;
        s.params = params;
        registration_refused(&s, BAD[i].text);
        err_has("parameter 'b'");
        sdm_option option = {"c",        SDM_OPTION_REAL, "",   BAD[i].min,
                             BAD[i].max, BAD[i].def,      NULL, ""};
        s = GOOD;
        s.options = &option, s.n_options = 1;
        registration_refused(&s, BAD[i].text);
        err_has("option 'c'");
    }
    sdm_param params[2] = {PARAMS[0], PARAMS[0]};
    sdm_shape s = GOOD;
    s.params = params;
    registration_refused(&s, "two parameters are named 'size'");
    params[1] = PARAMS[1];
    params[1].unit = NULL;
    registration_refused(&s, "parameter 'shift' has no unit");
    // all mistakes are told at once
    params[0].max = params[0].min;
    s.summary = NULL;
    registration_refused(&s, "no summary");
    err_has("; parameter 'size' has the range");
    err_has("; parameter 'shift' has no unit");
    s = GOOD;
    s.params = NULL;
    registration_refused(&s, "2 parameters, but no table");
    s.n_params = 0;
    registration_refused(&s, "no parameters");
    s = GOOD;
    s.n_params = 65;
    registration_refused(&s, "65 parameters, at most 64");
}

static void test_options_are_checked(void **state)
{
    (void)state;
    sdm_option option = {"c", SDM_OPTION_CHOICE, "", 0, 0, 0, NULL, ""};
    sdm_shape s = GOOD;
    s.options = &option, s.n_options = 1;
    registration_refused(&s, "option 'c' has no choices");
    static const char *const BAD[] = {"a||b", "|a", "a|", "a|b|a"};
    for (size_t i = 0; i < 4; i++) {
        option.choices = BAD[i];
        registration_refused(&s, "empty, long or repeated choice");
    }
    option = (sdm_option){"c", SDM_OPTION_INT, "", 0, 10, 0.5, NULL, ""};
    registration_refused(&s, "is an integer");
    option.type = (sdm_option_type)9;
    registration_refused(&s, "unknown type 9");
    sdm_option twice[2] = {OPTIONS[0], OPTIONS[0]};
    s.options = twice, s.n_options = 2;
    registration_refused(&s, "two options are named 'mode'");
    s.options = NULL;
    registration_refused(&s, "2 options, but no table");
}

static int create(const sdm_host *host, const sdm_option_value *options, void **self)
{
    (void)host, (void)options;
    *self = malloc(16);
    return 0;
}

static void describe_two(const void *self, const sdm_param **params, uint32_t *n_params)
{
    (void)self;
    static const sdm_param MANY[] = {{"m1", "sd", -3, 3, 0, ""}, {"m2", "sd", -3, 3, 0, ""}};
    *params = MANY, *n_params = 2;
}

static void describe_badly(const void *self, const sdm_param **params, uint32_t *n_params)
{
    (void)self;
    static const sdm_param MANY[] = {{"m1", "sd", -3, 3, 0, ""}, {"m1", "sd", -3, 3, 0, ""}};
    *params = MANY, *n_params = 2;
}

static void test_callbacks_are_checked(void **state)
{
    (void)state;
    sdm_shape s = GOOD;
    s.mesh = NULL;
    registration_refused(&s, "no callback mesh()");
    s = GOOD;
    s.create = create;
    registration_refused(&s, "callback destroy() is missing");
    s = GOOD;
    s.destroy = free;
    registration_refused(&s, "callback create() is missing");
    s = GOOD;
    s.describe = describe_two;
    registration_refused(&s, "describe() needs create()");
    s = GOOD;
    s.summary = NULL;
    registration_refused(&s, "no summary");
}

// The option that mirrors a shape exists and has two choices.
static void test_mirror_is_checked(void **state)
{
    (void)state;
    static const sdm_option SIDES[] = {
        {"side", SDM_OPTION_CHOICE, "", 0, 0, 0, "left|right", ""},
        {"three", SDM_OPTION_CHOICE, "", 0, 0, 0, "left|right|both", ""},
        {"edge", SDM_OPTION_REAL, "mm", 0.1, 1, 0.5, NULL, ""}};
    sdm_shape s = GOOD;
    s.options = SIDES, s.n_options = 3;
    s.mirror = "three";
    registration_refused(&s, "mirror 'three': need an option of two choices");
    s.mirror = "edge";
    registration_refused(&s, "mirror 'edge'");
    s.mirror = "none";
    registration_refused(&s, "mirror 'none'");
    s.mirror = "side";
    assert_int_equal(sdm_registry_add(registry, &s, "x", &err), SDM_OK);
}

static void test_registry_refuses_wrong_arguments(void **state)
{
    (void)state;
    assert_int_equal(sdm_registry_add(NULL, &GOOD, "x", &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_add(registry, NULL, "x", &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_add(registry, &GOOD, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_load(registry, "", &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_load_path(NULL, "x", &err), SDM_E_ARG);
    assert_int_equal(sdm_registry_load_path(registry, NULL, &err), SDM_OK);
    assert_int_equal(sdm_registry_load_path(registry, "::", &err), SDM_OK);
    assert_int_equal(sdm_registry_load_path(registry, "/there/is/none", &err), SDM_OK);
    assert_string_equal(sdm_registry_skipped(registry, 0),
                        "plug-in folder /there/is/none: No such file or directory");
    assert_true(sdm_registry_skipped_folder(registry, 0));
    assert_false(sdm_registry_skipped_folder(registry, 1));
    assert_false(sdm_registry_skipped_folder(NULL, 0));
    assert_null(sdm_registry_find(registry, "x", NULL));
    assert_null(sdm_registry_at(registry, 0));
    assert_null(sdm_registry_origin(registry, 0));
    sdm_registry_free(NULL);
    sdm_instance_free(NULL);
}

static void test_find_suggests_the_nearest_name(void **state)
{
    (void)state;
    assert_int_equal(sdm_builtin_shapes_add(registry, &err), SDM_OK);
    static const char *const NAMES[] = {"cochlea", "duct",    "ellipsoid",  "torus",
                                        "capsule", "linkage", "statistical"};
    assert_int_equal(sdm_registry_count(registry), 7);
    for (size_t i = 0; i < 7; i++) {
        assert_string_equal(sdm_registry_at(registry, i)->name, NAMES[i]);
        assert_string_equal(sdm_registry_origin(registry, i), "built in");
        assert_ptr_equal(sdm_registry_find(registry, NAMES[i], NULL), sdm_registry_at(registry, i));
    }
    const char *nearest = NULL;
    assert_null(sdm_registry_find(registry, "cochlae", &nearest));
    assert_string_equal(nearest, "cochlea");
    assert_null(sdm_registry_find(registry, "spaceship", &nearest));
    assert_null(nearest);
    const sdm_shape *first = sdm_registry_at(registry, 0);
    // Pointers to shapes stay valid while the registry grows.
    for (int i = 0; i < 40; i++) {
        static char names[40][16];
        snprintf(names[i], sizeof names[i], "shape%d", i);
        sdm_shape s = GOOD;
        s.name = names[i];
        assert_int_equal(sdm_registry_add(registry, &s, "test", &err), SDM_OK);
        assert_ptr_equal(sdm_registry_at(registry, 0), first);
    }
    assert_int_equal(sdm_builtin_shapes_add(registry, &err), SDM_E_PLUGIN);
    err_has("built in: shape 'cochlea' is there already (built in)");
}

static sdm_status instance_of(const sdm_shape *s, const char *name, const char *value,
                              const char *base, sdm_instance **out)
{
    const sdm_named_text given = {name, value};
    return sdm_instance_create(s, &given, name ? 1 : 0, base, out, &err);
}

static void test_option_text_is_parsed(void **state)
{
    (void)state;
    sdm_instance *s = NULL;
    assert_int_equal(instance_of(&GOOD, NULL, NULL, NULL, &s), SDM_OK);
    const sdm_option_value *v = sdm_instance_options(s);
    assert_true(v[MODE].number == 0 && v[LEVEL].number == 0.25 && v[COUNT].number == 4);
    assert_string_equal(v[MODE].text, "good");
    assert_string_equal(v[DATA].text, "");
    sdm_instance_free(s);

    static const struct {
        const char *name, *value, *base;
        int index;
        double number;
        const char *text;
    } FINE[] = {{"mode", "index", NULL, MODE, 3, "index"},
                {"level", "-1", NULL, LEVEL, -1, ""},
                {"level", "1.5e0", NULL, LEVEL, 1.5, ""},
                {"count", "10", NULL, COUNT, 10, ""},
                {"data", "a/b.ply", "/c d", DATA, 0, "/c d/a/b.ply"},
                {"data", "/a.ply", "/c", DATA, 0, "/a.ply"},
                {"data", "a.ply", NULL, DATA, 0, "a.ply"},
                {"data", "", "/c", DATA, 0, ""}};
    for (size_t i = 0; i < sizeof FINE / sizeof *FINE; i++) {
        assert_int_equal(instance_of(&GOOD, FINE[i].name, FINE[i].value, FINE[i].base, &s), SDM_OK);
        v = sdm_instance_options(s) + FINE[i].index;
        assert_true(v->number == FINE[i].number);
        assert_string_equal(v->text, FINE[i].text);
        sdm_instance_free(s);
    }

    static const char *const BAD[][3] = {
        {"levle", "1", "shape 'tetra' has no option 'levle'; did you mean 'level'?"},
        {"elephant", "1",
         "shape 'tetra' has no option 'elephant'; its options are mode, level, count, data"},
        {"mode", "god", "option 'mode' is 'god'; did you mean 'good'?"},
        {"mode", "xyzxyzxyz", "option 'mode' is 'xyzxyzxyz', need one of good|nan"},
        {"mode", "", "option 'mode' is '', need one of"},
        {"level", "wide", "option 'level' is 'wide', need a number"},
        {"level", "nan", "need a number"},
        {"level", "1.6", "option 'level' is 1.6 mm, need -1 .. 1.5"},
        {"count", "2.5", "option 'count' is '2.5', need an integer"},
        {"count", "0", "option 'count' is 0, need 1 .. 10"},
        {"count", "11", "option 'count' is 11, need 1 .. 10"},
    };
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        s = NULL;
        assert_int_equal(instance_of(&GOOD, BAD[i][0], BAD[i][1], NULL, &s), SDM_E_CONFIG);
        err_has(BAD[i][2]);
        assert_null(s);
    }
    const sdm_named_text twice[] = {{"level", "1"}, {"level", "1"}}, none[] = {{"level", NULL}};
    assert_int_equal(sdm_instance_create(&GOOD, twice, 2, NULL, &s, &err), SDM_E_CONFIG);
    err_has("option 'level' is given twice");
    assert_int_equal(sdm_instance_create(&GOOD, none, 1, NULL, &s, &err), SDM_E_ARG);
    assert_int_equal(sdm_instance_create(NULL, NULL, 0, NULL, &s, &err), SDM_E_ARG);
    err_has("the shape is NULL, as sdm_registry_find() gives it for an unknown name");
    assert_int_equal(sdm_instance_create(&GOOD, NULL, 2, NULL, &s, &err), SDM_E_ARG);
    err_has("the 2 options are NULL");
    assert_int_equal(sdm_instance_create(&GOOD, NULL, 0, NULL, NULL, &err), SDM_E_ARG);
}

static void test_parameters_must_be_in_range(void **state)
{
    (void)state;
    sdm_instance *s = NULL;
    assert_int_equal(instance_of(&GOOD, NULL, NULL, NULL, &s), SDM_OK);
    const double fine[][2] = {{1, -1}, {3, 1}, {2, 0}, {2, -0.0}};
    for (size_t i = 0; i < 4; i++) assert_int_equal(sdm_instance_check(s, fine[i], &err), SDM_OK);
    const double bad[][2] = {{nextafter(1, 0), 0},   {nextafter(3, 4), 0},
                             {2, nextafter(-1, -2)}, {NAN, 0},
                             {2, INFINITY},          {-INFINITY, 0}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        sdm_mesh m = {0};
        double v[24], d;
        const double x[3] = {0};
        assert_int_equal(sdm_instance_check(s, bad[i], &err), SDM_E_RANGE);
        err_has(i == 2 || i == 4 ? "shape 'tetra': parameter 'shift' = "
                                 : "shape 'tetra': parameter 'size' = ");
        err_has(i == 2 || i == 4 ? "mm, allowed -1 .. 1 mm" : "mm, allowed 1 .. 3 mm");
        assert_int_equal(sdm_instance_mesh(s, bad[i], &m, &err), SDM_E_RANGE);
        assert_int_equal(sdm_instance_velocity(s, bad[i], 4, v, &err), SDM_E_RANGE);
        assert_int_equal(sdm_instance_distance(s, bad[i], x, &d, &err), SDM_E_RANGE);
        assert_null(m.vert);
    }
    assert_int_equal(sdm_instance_check(s, bad[0], &err), SDM_E_RANGE);
    // A difference of one unit in the last place is detected, and all digits are printed.
    err_has("= 0.9999999999999999 mm, allowed");
    assert_int_equal(sdm_instance_check(s, bad[3], &err), SDM_E_RANGE);
    err_has("= nan mm");
    assert_int_equal(sdm_instance_check(s, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_instance_param_index(s, "shift"), 1);
    assert_int_equal(sdm_instance_param_index(s, "shit"), -1);
    assert_int_equal(sdm_instance_param_index(s, NULL), -1);
    sdm_instance_free(s);
}

static void test_bad_meshes_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *mode;
        sdm_status status;
        const char *text;
    } CASES[] = {
        {"nan", SDM_E_PLUGIN,
         "shape 'tetra' at size=2.5 shift=-0.25: vertex 2 has a coordinate that is not finite"},
        {"infinite", SDM_E_PLUGIN, "vertex 1 has a coordinate that is not finite"},
        {"index", SDM_E_PLUGIN, "triangle 3 has vertex 4, but there are 4 vertices"},
        {"lazy", SDM_E_PLUGIN, "triangle 2 of 4 was reserved, but never written"},
        {"empty", SDM_E_PLUGIN, "the mesh has no triangle"},
        {"error", SDM_E_PLUGIN, "shape 'tetra' at size=2.5 shift=-0.25: the size is unlucky"},
        {"mute", SDM_E_PLUGIN, "mesh() returned 7 without a reason"},
        {"resize", SDM_E_PLUGIN, "leave sizes and pointers as they are"},
        {"swap", SDM_E_PLUGIN, "leave sizes and pointers as they are"},
        {"skip", SDM_E_PLUGIN, "mesh() must fill what reserve() gave"},
        {"file", SDM_E_PLUGIN, "/dev/null: files are read in create() alone"},
        {"memory", SDM_E_NOMEM, "shape 'tetra' at size=2.5"},
        {"vertex", SDM_E_PLUGIN, "mesh() has written beyond the 4 vertices that it reserved"},
        {"triangle", SDM_E_PLUGIN, "mesh() has written beyond the 4 triangles that it reserved"},
        {"huge", SDM_E_PLUGIN, "mesh of 1099511627776 vertices"},
    };
    const double p[2] = {2.5, -0.25};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        sdm_instance *s = NULL;
        sdm_mesh m = {0};
        assert_int_equal(instance_of(&GOOD, "mode", CASES[i].mode, NULL, &s), SDM_OK);
        assert_int_equal(sdm_instance_mesh(s, p, &m, &err), CASES[i].status);
        err_has(CASES[i].text);
        assert_int_equal(m.n_vert + m.n_tri, 0); // no partial mesh is left
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
    sdm_instance *s = NULL;
    sdm_mesh m = {0};
    assert_int_equal(instance_of(&GOOD, NULL, NULL, NULL, &s), SDM_OK);
    // The same mesh object is filled again.
    for (int i = 0; i < 3; i++) {
        assert_int_equal(sdm_instance_mesh(s, p, &m, &err), SDM_OK);
        assert_int_equal(m.n_vert, 4);
        assert_int_equal(m.n_tri, 4);
        assert_true(m.vert[3] == 2.5625 && m.tri[11] == 3);
    }
    assert_int_equal(sdm_instance_mesh(s, p, NULL, &err), SDM_E_ARG);
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

static void test_distance_is_checked(void **state)
{
    (void)state;
    const double p[2] = {2, 0}, x[3] = {5, 0, 0}, bad[3] = {0, NAN, 0};
    double d = 0;
    sdm_instance *s = NULL;
    assert_int_equal(instance_of(&GOOD, NULL, NULL, NULL, &s), SDM_OK);
    assert_int_equal(sdm_instance_distance(s, p, x, &d, &err), SDM_OK);
    assert_true(d == 5);
    assert_int_equal(sdm_instance_distance(s, p, bad, &d, &err), SDM_E_ARG);
    assert_int_equal(sdm_instance_distance(s, p, NULL, &d, &err), SDM_E_ARG);
    sdm_instance_free(s);
    assert_int_equal(instance_of(&GOOD, "mode", "nan", NULL, &s), SDM_OK);
    assert_int_equal(sdm_instance_distance(s, p, x, &d, &err), SDM_E_PLUGIN);
    err_has("distance() gives a number that is not finite");
    sdm_instance_free(s);
    sdm_shape without = GOOD;
    without.distance = NULL;
    assert_int_equal(instance_of(&without, NULL, NULL, NULL, &s), SDM_OK);
    assert_int_equal(sdm_instance_distance(s, p, x, &d, &err), SDM_E_UNSUPPORTED);
    err_has("shape 'tetra' has no closed-form distance");
    sdm_instance_free(s);
}

// Velocities by finite differences: exact for d/dsize (linear), error of second order for d/dshift
// (quadratic), also at the ends of the ranges.
static void test_velocity_by_differences(void **state)
{
    (void)state;
    const double at[][2] = {{2, 0.3}, {1, -1}, {3, 1}, {1.0000001, 0.9999999}};
    sdm_instance *s = NULL;
    assert_int_equal(instance_of(&GOOD, NULL, NULL, NULL, &s), SDM_OK);
    double v[24];
    for (size_t i = 0; i < 4; i++) {
        assert_int_equal(sdm_instance_velocity(s, at[i], 4, v, &err), SDM_OK);
        for (int k = 0; k < 12; k++) {
            const double size = k == 3 || k == 7 || k == 11 ? 1 : 0,
                         shift = k % 3 ? 0 : 2 * at[i][1];
            assert_true(fabs(v[k] - size) < 1e-9 && fabs(v[12 + k] - shift) < 1e-9);
        }
    }
    assert_int_equal(sdm_instance_velocity(s, at[0], 5, v, &err), SDM_E_PLUGIN);
    err_has("the mesh has 4 vertices, velocities of 5 were asked for");
    assert_int_equal(sdm_instance_velocity(s, at[0], 4, NULL, &err), SDM_E_ARG);
    sdm_instance_free(s);

    sdm_shape with = GOOD;
    with.velocity = velocity;
    assert_int_equal(instance_of(&with, NULL, NULL, NULL, &s), SDM_OK);
    assert_int_equal(sdm_instance_velocity(s, at[0], 4, v, &err), SDM_OK);
    assert_true(v[23] == 1);
    sdm_instance_free(s);
    assert_int_equal(instance_of(&with, "mode", "nan", NULL, &s), SDM_OK);
    assert_int_equal(sdm_instance_velocity(s, at[0], 4, v, &err), SDM_E_PLUGIN);
    err_has("velocity of vertex 1 with respect to 'shift' is not finite");
    sdm_instance_free(s);
}

static int mesh_of_year(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 3, 1);
    if (failed) return failed;
    for (uint32_t i = 0; i < 9; i++) out->vert[i] = i * (p[0] - 1e6);
    for (uint32_t i = 0; i < 3; i++) out->tri[i] = i;
    return 0;
}

// A parameter near 1e6 rounds the steps of the differences; the quotients must use the steps
// actually taken.
static void test_velocity_with_rounded_steps(void **state)
{
    (void)state;
    static const sdm_param year[] = {{"year", "", 1e6, 1e6 + 1, 1e6 + 0.5, ""}};
    sdm_shape shape = GOOD;
    shape.params = year;
    shape.n_params = 1;
    shape.mesh = mesh_of_year;
    sdm_instance *s = NULL;
    assert_int_equal(instance_of(&shape, NULL, NULL, NULL, &s), SDM_OK);
    const double at[] = {1e6 + 0.3, 1e6, 1e6 + 1, 1e6 + 1e-6};
    for (size_t i = 0; i < 4; i++) {
        double v[9];
        assert_int_equal(sdm_instance_velocity(s, &at[i], 3, v, &err), SDM_OK);
        for (int k = 0; k < 9; k++) assert_true(fabs(v[k] - k) < 1e-9);
    }
    sdm_instance_free(s);
}

static int create_fails(const sdm_host *host, const sdm_option_value *options, void **self)
{
    (void)self;
    const unsigned char *data;
    size_t size;
    return host->read_file(host, options[DATA].text, &data, &size);
}

static int create_reads(const sdm_host *host, const sdm_option_value *options, void **self)
{
    const unsigned char *data;
    size_t size;
    sdm_mesh_out scratch = {0}, second = {0};
    const int failed = host->read_file(host, options[DATA].text, &data, &size) ||
                       host->reserve(host, &scratch, 3, 1) || host->reserve(host, &second, 3, 1);
    if (failed) return 1;
    if (scratch.vert == second.vert || host->abi != SDM_SHAPE_ABI || host->size != sizeof(sdm_host))
        return 1;
    char *kept = calloc(1, size + 1);
    if (!kept) return 1;
    memcpy(kept, data, size);
    *self = kept;
    return 0;
}

static void test_create_may_fail(void **state)
{
    (void)state;
    sdm_shape shape = GOOD;
    sdm_instance *s = NULL;
    shape.create = create_fails, shape.destroy = free;
    assert_int_equal(instance_of(&shape, "data", "missing.bin", "/nowhere", &s), SDM_E_PLUGIN);
    err_has("shape 'tetra': ");
    err_has("/nowhere/missing.bin");
    assert_null(s);

    FILE *f = fopen("test_registry_data.bin", "wb");
    assert_non_null(f);
    fputs("content", f);
    fclose(f);
    shape.create = create_reads;
    assert_int_equal(instance_of(&shape, "data", "test_registry_data.bin", ".", &s), SDM_OK);
    sdm_instance_free(s);

    shape.create = create, shape.describe = describe_two;
    assert_int_equal(instance_of(&shape, NULL, NULL, NULL, &s), SDM_OK);
    size_t n = 0;
    assert_string_equal(sdm_instance_params(s, &n)[1].name, "m2");
    assert_int_equal(n, 2);
    assert_ptr_equal(sdm_instance_shape(s), &shape);
    sdm_instance_free(s);
    shape.describe = describe_badly;
    assert_int_equal(instance_of(&shape, NULL, NULL, NULL, &s), SDM_E_PLUGIN);
    err_has("shape 'tetra', describe(): two parameters are named 'm1'");
}

static sdm_distribution stated[2];

static void state_distributions(const void *self, sdm_distribution *out)
{
    (void)self;
    for (int i = 0; i < 2; i++) {
        assert_true(out[i].kind == SDM_DISTRIBUTION_UNIFORM && out[i].mean == 0);
        out[i] = stated[i];
    }
}

static void test_distributions_are_checked(void **state)
{
    (void)state;
    sdm_instance *s = NULL;
    assert_int_equal(instance_of(&GOOD, NULL, NULL, NULL, &s), SDM_OK);
    for (int i = 0; i < 2; i++)
        assert_int_equal(sdm_instance_distributions(s)[i].kind, SDM_DISTRIBUTION_UNIFORM);
    sdm_instance_free(s);

    sdm_shape shape = GOOD;
    shape.distributions = state_distributions;
    stated[0] = (sdm_distribution){SDM_DISTRIBUTION_UNIFORM, 7, NAN}; // figures without meaning
    stated[1] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0.5, 0.25};
    assert_int_equal(instance_of(&shape, NULL, NULL, NULL, &s), SDM_OK);
    const sdm_distribution *d = sdm_instance_distributions(s);
    assert_true(d[0].kind == SDM_DISTRIBUTION_UNIFORM && d[0].mean == 0 && d[0].deviation == 0);
    assert_true(d[1].kind == SDM_DISTRIBUTION_NORMAL && d[1].mean == 0.5 && d[1].deviation == 0.25);
    sdm_instance_free(s);

    static const struct {
        sdm_distribution d;
        const char *text;
    } BAD[] = {{{(sdm_distribution_kind)9, 0, 1}, "distribution of the unknown kind 9"},
               {{SDM_DISTRIBUTION_NORMAL, NAN, 1}, "the mean nan is not finite"},
               {{SDM_DISTRIBUTION_NORMAL, 0, 0}, "the deviation 0 is not a finite number above 0"},
               {{SDM_DISTRIBUTION_NORMAL, 8, 1}, "has no values in the range -1 .. 1"}};
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        stated[1] = BAD[i].d;
        assert_int_equal(instance_of(&shape, NULL, NULL, NULL, &s), SDM_E_PLUGIN);
        err_has("shape 'tetra', distributions(): parameter 'shift': ");
        err_has(BAD[i].text);
        assert_null(s);
    }
}

// Each allocation fails once: no leak (detected by the sanitizer build), and the registry stays
// usable.
static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    unsigned long n = 1;
    for (;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status s = sdm_builtin_shapes_add(registry, &err);
        sdm_alloc_fail_after(0);
        if (s == SDM_OK) break;
        assert_int_equal(s, SDM_E_NOMEM);
        sdm_registry_free(registry);
        assert_int_equal(sdm_registry_create(&registry, NULL), SDM_OK);
    }
    assert_true(n > 10);
    const sdm_shape *cochlea = sdm_registry_find(registry, "cochlea", NULL);
    for (n = 1;; n++) {
        sdm_instance *s = NULL;
        sdm_alloc_fail_after(n);
        const sdm_status status = sdm_instance_create(cochlea, NULL, 0, NULL, &s, &err);
        sdm_alloc_fail_after(0);
        sdm_instance_free(s);
        if (status == SDM_OK) break;
        assert_int_equal(status, SDM_E_NOMEM);
    }
    assert_true(n > 2);
}

int main(void)
{
#define WITH_REGISTRY(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        WITH_REGISTRY(test_names_are_checked),
        WITH_REGISTRY(test_parameters_are_checked),
        WITH_REGISTRY(test_options_are_checked),
        WITH_REGISTRY(test_callbacks_are_checked),
        WITH_REGISTRY(test_mirror_is_checked),
        WITH_REGISTRY(test_find_suggests_the_nearest_name),
        WITH_REGISTRY(test_registry_refuses_wrong_arguments),
        cmocka_unit_test(test_option_text_is_parsed),
        cmocka_unit_test(test_parameters_must_be_in_range),
        cmocka_unit_test(test_bad_meshes_are_refused),
        cmocka_unit_test(test_distance_is_checked),
        cmocka_unit_test(test_velocity_by_differences),
        cmocka_unit_test(test_velocity_with_rounded_steps),
        cmocka_unit_test(test_create_may_fail),
        cmocka_unit_test(test_distributions_are_checked),
        WITH_REGISTRY(test_each_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
