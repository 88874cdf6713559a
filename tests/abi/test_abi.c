/* The plug-in interface is frozen: tests the memory layout of version 1, shape tables that are
 * shorter or longer than the current one, and the loading of valid and invalid shared objects.
 * Tests: loader.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/mesh.h"

#ifndef PLUGIN_FOLDER
// one folder for each variant of bad_plugin.c, and good/octahedron.so
#define PLUGIN_FOLDER "plugins"
#endif

/* Version 1 as it was published. Never edit these structures: if sdm/shape.h differs from them, the
 * static assertions below must stop the compiler. */
struct param_v1 {
    const char *name, *unit;
    double min, max, def;
    const char *help;
};
struct option_v1 {
    const char *name;
    int type;
    const char *unit;
    double min, max, def;
    const char *choices, *help;
};
struct option_value_v1 {
    double number;
    const char *text;
};
struct mesh_out_v1 {
    double *vert;
    uint32_t *tri;
    size_t n_vert, n_tri;
};
struct host_v1 {
    uint32_t abi, size;
    void *ctx;
    int (*reserve)(const struct sdm_host *, sdm_mesh_out *, size_t, size_t);
    int (*fail)(const struct sdm_host *, const char *);
    int (*read_file)(const struct sdm_host *, const char *, const unsigned char **, size_t *);
    int (*read_mesh)(const struct sdm_host *, const char *, sdm_mesh_out *);
    int (*read_npy)(const struct sdm_host *, const char *, const double **, size_t[4], int *);
};
struct shape_v1 {
    uint32_t abi, size;
    const char *name, *summary;
    const sdm_param *params;
    uint32_t n_params;
    const sdm_option *options;
    uint32_t n_options;
    int (*create)(const sdm_host *, const sdm_option_value *, void **);
    void (*destroy)(void *);
    void (*describe)(const void *, const sdm_param **, uint32_t *);
    int (*mesh)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                sdm_mesh_out *);
    int (*velocity)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                    size_t, double *);
    int (*distance)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                    const double[3], double *);
};

/* Members that later versions added at the end. Never edit these either. */
struct distribution_added {
    int kind;
    double mean, deviation;
};
struct shape_added {
    struct shape_v1 v1;
    void (*distributions)(const void *, sdm_distribution *);
    const char *mirror;
    const sdm_measure *measures;
    uint32_t n_measures;
    int (*measure)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                   uint32_t, double, double *);
    int (*open_end)(const void *, const sdm_host *, const sdm_option_value *, const double *,
                    sdm_open_end *);
};
struct open_end_added {
    double centre[3], outward[3], radius;
};
struct measure_added {
    const char *name, *unit, *help;
    int of_depth;
};

#define SAME_OFFSET(v1, now, field)                                                                \
    _Static_assert(offsetof(struct v1, field) == offsetof(now, field), #field " has moved")
_Static_assert(SDM_SHAPE_ABI == 1, "a new interface version needs a frozen copy of its own");
// structures that a plug-in passes as arrays must keep their size; the others may grow at the end
_Static_assert(sizeof(struct param_v1) == sizeof(sdm_param), "sdm_param has changed");
_Static_assert(sizeof(struct option_v1) == sizeof(sdm_option), "sdm_option has changed");
_Static_assert(sizeof(struct option_value_v1) == sizeof(sdm_option_value),
               "sdm_option_value has changed");
_Static_assert(sizeof(struct mesh_out_v1) == sizeof(sdm_mesh_out), "sdm_mesh_out has changed");
_Static_assert(sizeof(struct host_v1) <= sizeof(sdm_host), "sdm_host has shrunk");
_Static_assert(sizeof(struct shape_v1) <= sizeof(sdm_shape), "sdm_shape has shrunk");
SAME_OFFSET(param_v1, sdm_param, unit);
SAME_OFFSET(param_v1, sdm_param, min);
SAME_OFFSET(param_v1, sdm_param, max);
SAME_OFFSET(param_v1, sdm_param, def);
SAME_OFFSET(param_v1, sdm_param, help);
SAME_OFFSET(option_v1, sdm_option, type);
SAME_OFFSET(option_v1, sdm_option, unit);
SAME_OFFSET(option_v1, sdm_option, min);
SAME_OFFSET(option_v1, sdm_option, max);
SAME_OFFSET(option_v1, sdm_option, def);
SAME_OFFSET(option_v1, sdm_option, choices);
SAME_OFFSET(option_v1, sdm_option, help);
SAME_OFFSET(option_value_v1, sdm_option_value, text);
SAME_OFFSET(mesh_out_v1, sdm_mesh_out, tri);
SAME_OFFSET(mesh_out_v1, sdm_mesh_out, n_vert);
SAME_OFFSET(mesh_out_v1, sdm_mesh_out, n_tri);
SAME_OFFSET(host_v1, sdm_host, abi);
SAME_OFFSET(host_v1, sdm_host, size);
SAME_OFFSET(host_v1, sdm_host, ctx);
SAME_OFFSET(host_v1, sdm_host, reserve);
SAME_OFFSET(host_v1, sdm_host, fail);
SAME_OFFSET(host_v1, sdm_host, read_file);
SAME_OFFSET(host_v1, sdm_host, read_mesh);
SAME_OFFSET(host_v1, sdm_host, read_npy);
SAME_OFFSET(shape_v1, sdm_shape, abi);
SAME_OFFSET(shape_v1, sdm_shape, size);
SAME_OFFSET(shape_v1, sdm_shape, name);
SAME_OFFSET(shape_v1, sdm_shape, summary);
SAME_OFFSET(shape_v1, sdm_shape, params);
SAME_OFFSET(shape_v1, sdm_shape, n_params);
SAME_OFFSET(shape_v1, sdm_shape, options);
SAME_OFFSET(shape_v1, sdm_shape, n_options);
SAME_OFFSET(shape_v1, sdm_shape, create);
SAME_OFFSET(shape_v1, sdm_shape, destroy);
SAME_OFFSET(shape_v1, sdm_shape, describe);
SAME_OFFSET(shape_v1, sdm_shape, mesh);
SAME_OFFSET(shape_v1, sdm_shape, velocity);
SAME_OFFSET(shape_v1, sdm_shape, distance);
SAME_OFFSET(shape_added, sdm_shape, distributions);
SAME_OFFSET(shape_added, sdm_shape, mirror);
SAME_OFFSET(shape_added, sdm_shape, measures);
SAME_OFFSET(shape_added, sdm_shape, n_measures);
SAME_OFFSET(shape_added, sdm_shape, measure);
SAME_OFFSET(shape_added, sdm_shape, open_end);
SAME_OFFSET(open_end_added, sdm_open_end, outward);
SAME_OFFSET(open_end_added, sdm_open_end, radius);
_Static_assert(sizeof(struct open_end_added) == sizeof(sdm_open_end), "sdm_open_end has changed");
SAME_OFFSET(measure_added, sdm_measure, unit);
SAME_OFFSET(measure_added, sdm_measure, help);
SAME_OFFSET(measure_added, sdm_measure, of_depth);
_Static_assert(sizeof(struct measure_added) == sizeof(sdm_measure), "sdm_measure has changed");
SAME_OFFSET(distribution_added, sdm_distribution, mean);
SAME_OFFSET(distribution_added, sdm_distribution, deviation);
_Static_assert(sizeof(struct distribution_added) == sizeof(sdm_distribution),
               "sdm_distribution has changed");
_Static_assert(SDM_DISTRIBUTION_UNIFORM == 0 && SDM_DISTRIBUTION_NORMAL == 1, "distributions");
_Static_assert(SDM_OPTION_REAL == 0 && SDM_OPTION_INT == 1 && SDM_OPTION_CHOICE == 2 &&
                   SDM_OPTION_FILE == 3,
               "option types");

static sdm_registry *registry;
static sdm_error err;

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

static void error_contains(const char *text)
{
    if (!strstr(err.text, text)) fail_msg("'%s' is not in '%s'", text, err.text);
}

static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, 4, 4);
    if (failed) return failed;
    static const uint32_t TRI[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    memcpy(out->tri, TRI, sizeof TRI);
    for (int i = 0; i < 12; i++) out->vert[i] = 0;
    for (int k = 0; k < 3; k++) out->vert[3 * (k + 1) + k] = p[0];
    return 0;
}

static const sdm_param PARAMS[] = {{"size", "mm", 1, 2, 1.5, "size"}};

static struct shape_v1 table_v1(void)
{
    return (struct shape_v1){.abi = 1,
                             .size = sizeof(struct shape_v1),
                             .name = "old",
                             .summary = "test",
                             .params = PARAMS,
                             .n_params = 1,
                             .mesh = mesh};
}

// Adds a table in a heap block of exactly its size, so that AddressSanitizer reports any access
// beyond its end.
static sdm_status table_add(const void *bytes, size_t size)
{
    void *block = malloc(size);
    assert_non_null(block);
    memcpy(block, bytes, size);
    const sdm_status s = sdm_registry_add(registry, block, "block", &err);
    free(block);
    return s;
}

static void check_mesh_of(const sdm_shape *shape)
{
    sdm_instance *s = NULL;
    sdm_mesh m = {0};
    const double p = 1.25;
    assert_int_equal(sdm_instance_create(shape, NULL, 0, NULL, &s, &err), SDM_OK);
    assert_int_equal(sdm_instance_mesh(s, &p, &m, &err), SDM_OK);
    assert_true(m.n_tri == 4 && m.vert[3] == 1.25);
    assert_int_equal(sdm_instance_distributions(s)[0].kind, SDM_DISTRIBUTION_UNIFORM);
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

static void size_is_normal(const void *self, sdm_distribution *out)
{
    (void)self;
    assert_int_equal(out[0].kind, SDM_DISTRIBUTION_UNIFORM);
    out[0] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 1.5, 0.25};
}

// A table with distributions(), which the table of version 1 lacks.
static void test_distributions_are_read(void **state)
{
    (void)state;
    struct shape_added table = {.v1 = table_v1(), .distributions = size_is_normal};
    table.v1.size = sizeof table;
    assert_int_equal(table_add(&table, sizeof table), SDM_OK);
    sdm_instance *s = NULL;
    assert_int_equal(
        sdm_instance_create(sdm_registry_find(registry, "old", NULL), NULL, 0, NULL, &s, &err),
        SDM_OK);
    const sdm_distribution *d = sdm_instance_distributions(s);
    assert_true(d->kind == SDM_DISTRIBUTION_NORMAL && d->mean == 1.5 && d->deviation == 0.25);
    sdm_instance_free(s);
}

static void test_table_of_version_1_is_accepted(void **state)
{
    (void)state;
    const struct shape_v1 table = table_v1();
    assert_int_equal(table_add(&table, sizeof table), SDM_OK);
    check_mesh_of(sdm_registry_find(registry, "old", NULL));
}

// A table that ends after its member mesh: all later members count as NULL.
static void test_missing_members_count_as_null(void **state)
{
    (void)state;
    struct shape_v1 table = table_v1();
    const size_t least = offsetof(struct shape_v1, mesh) + sizeof table.mesh;
    table.size = (uint32_t)least;
    assert_int_equal(table_add(&table, least), SDM_OK);
    const sdm_shape *shape = sdm_registry_find(registry, "old", NULL);
    assert_null(shape->velocity);
    assert_null(shape->distance);
    check_mesh_of(shape);

    for (size_t size = 8; size < least; size += 4) {
        table.size = (uint32_t)size;
        table.name = "short";
        assert_int_equal(table_add(&table, size), SDM_E_PLUGIN);
        error_contains("block: shape table of ");
        error_contains("set .size = sizeof(sdm_shape)");
    }
    table.size = 0;
    assert_int_equal(table_add(&table, 8), SDM_E_PLUGIN);
}

// A table of a later version: members beyond the known ones must be ignored.
static void test_unknown_members_are_ignored(void **state)
{
    (void)state;
    struct {
        struct shape_added known;
        void *later[4];
    } table = {.known.v1 = table_v1(), .later = {&table, &table, &table, &table}};
    _Static_assert(sizeof table.known == sizeof(sdm_shape), "later members are unknown ones");
    table.known.v1.size = sizeof table;
    assert_int_equal(table_add(&table, sizeof table), SDM_OK);
    const sdm_shape *shape = sdm_registry_find(registry, "old", NULL);
    assert_int_equal(shape->size, sizeof(sdm_shape));
    check_mesh_of(shape);
}

static void test_other_interface_versions_are_refused(void **state)
{
    (void)state;
    const uint32_t bad[] = {0, 2, 0x01000000, UINT32_MAX};
    for (size_t i = 0; i < 4; i++) {
        const uint32_t lead[2] = {bad[i],
                                  sizeof(sdm_shape)}; // nothing beyond these two words may be read
        assert_int_equal(table_add(lead, sizeof lead), SDM_E_PLUGIN);
        char text[128];
        snprintf(text, sizeof text,
                 "block: shape table of plug-in interface %u, this program has interface 1",
                 (unsigned)bad[i]);
        error_contains(text);
    }
    assert_int_equal(sdm_registry_count(registry), 0);
}

static void check_refused(const char *variant, sdm_status status, const char *text)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s/plugin.so", PLUGIN_FOLDER, variant);
    err.text[0] = '\0';
    const size_t before = sdm_registry_count(registry);
    assert_int_equal(sdm_registry_load(registry, path, &err), status);
    error_contains(variant); // the message names the file
    error_contains(text);
    assert_int_equal(sdm_registry_count(registry), before); // no shape of a refused file is added
}

static void test_bad_plugins_are_refused(void **state)
{
    (void)state;
    assert_int_equal(sdm_builtin_shapes_add(registry, &err), SDM_OK);
    check_refused("wrong_abi", SDM_E_PLUGIN,
                  "shape table of plug-in interface 2, this program has interface 1");
    check_refused("no_symbol", SDM_E_PLUGIN, "exports no function sdm_plugin_shape()");
    check_refused("no_shape", SDM_E_PLUGIN, "has no shape: sdm_plugin_shape(0) gives NULL");
    check_refused("endless", SDM_E_PLUGIN, "more than 256 shapes");
    check_refused("taken_name", SDM_E_PLUGIN, "shape 'torus' is there already (built in)");
    check_refused("second_bad", SDM_E_PLUGIN, "no callback mesh()");
    check_refused("undefined", SDM_E_PLUGIN, "a_function_without_definition");
    check_refused("missing", SDM_E_IO, "No such file or directory");
    assert_null(sdm_registry_find(registry, "lone", NULL));
}

static void file_write(const char *path, const void *bytes, size_t size)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(bytes, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

static void test_other_files_are_refused(void **state)
{
    (void)state;
    static const char TEXT[] = "this is no shared object, however long it may go on to be",
                      ELF[] = "\177ELF\2\1\1";
    file_write("test_abi_text.so", TEXT, sizeof TEXT);
    file_write("test_abi_cut.so", ELF, sizeof ELF);
    file_write("test_abi_empty.so", TEXT, 0);
    static const char *const FILES[] = {"test_abi_text.so", "test_abi_cut.so", "test_abi_empty.so"};
    for (size_t i = 0; i < 3; i++) {
        assert_int_equal(sdm_registry_load(registry, FILES[i], &err), SDM_E_PLUGIN);
        error_contains("cannot be loaded");
        error_contains(FILES[i]);
        remove(FILES[i]);
    }
    // a folder is no shared object
    assert_int_equal(sdm_registry_load(registry, ".", &err), SDM_E_PLUGIN);
}

// The example plug-in, found through a search path with a relative folder.
static void test_example_plugin_works(void **state)
{
    (void)state;
    assert_int_equal(sdm_registry_load_path(registry, ":" PLUGIN_FOLDER "/good:", &err), SDM_OK);
    assert_int_equal(sdm_registry_count(registry), 1);
    assert_int_equal(sdm_registry_origin(registry, 0)[0], '/'); // the path of origin is absolute
    const sdm_shape *shape = sdm_registry_find(registry, "octahedron", NULL);
    assert_non_null(shape);

    sdm_instance *s = NULL;
    assert_int_equal(sdm_instance_create(shape, NULL, 0, NULL, &s, &err), SDM_OK);
    const double p = 3;
    sdm_mesh m = {0};
    sdm_audit a;
    assert_int_equal(sdm_instance_mesh(s, &p, &m, &err), SDM_OK);
    assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_OK);
    assert_true(a.manifold && !a.inverted && a.self_intersections == 0);
    assert_true(fabs(a.volume - 4.0 / 3 * 27) < 1e-12); // volume of an octahedron: 4/3 r^3
    const double AT[][4] = {
        {0, 0, 0, -1.7320508075688772}, {5, 0, 0, 2}, {0, -3, 0, 0}, {2, 2, 2, 1.7320508075688772},
        {-3, 3, 0, 2.1213203435596424}, {1, 1, -1, 0}};
    for (size_t i = 0; i < sizeof AT / sizeof *AT; i++) {
        double d = 0;
        assert_int_equal(sdm_instance_distance(s, &p, AT[i], &d, &err), SDM_OK);
        assert_true(fabs(d - AT[i][3]) < 1e-12);
    }
    double v[18];
    assert_int_equal(sdm_instance_velocity(s, &p, 6, v, &err), SDM_OK);
    assert_true(fabs(v[0] - 1) < 1e-8 && fabs(v[3] + 1) < 1e-8 && fabs(v[1]) < 1e-8);
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

/* Copies a file and appends `extra` bytes. */
static void file_copy(const char *from, const char *to, size_t extra)
{
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    assert_true(in && out);
    for (int c; (c = getc(in)) != EOF;) putc(c, out);
    for (size_t i = 0; i < extra; i++) putc(0, out);
    fclose(in);
    fclose(out);
}

// A file under the same name, through a link or as a copy is the same; another file with a shape of
// the same name is a mistake, in a folder of the path one that is skipped.
static void test_same_file_is_loaded_once(void **state)
{
    (void)state;
    static const char *const FILE_NAME = PLUGIN_FOLDER "/good/octahedron.so";
    mkdir("test_abi_copies", 0777);
    assert_int_equal(symlink(FILE_NAME, "test_abi_copies/link.so"), 0);
    file_copy(FILE_NAME, "test_abi_copies/copy.so", 0);
    file_copy(FILE_NAME, "test_abi_copies/other.so", 8); // bytes after its sections do no harm
    assert_int_equal(sdm_registry_load(registry, FILE_NAME, &err), SDM_OK);
    assert_int_equal(sdm_registry_load(registry, FILE_NAME, &err), SDM_OK);
    assert_int_equal(sdm_registry_load(registry, "test_abi_copies/link.so", &err), SDM_OK);
    assert_int_equal(sdm_registry_load(registry, "test_abi_copies/copy.so", &err), SDM_OK);
    assert_int_equal(sdm_registry_count(registry), 1);
    assert_int_equal(sdm_registry_load(registry, "test_abi_copies/other.so", &err), SDM_E_PLUGIN);
    error_contains("shape 'octahedron' is there already (/");
    assert_null(sdm_registry_skipped(registry, 0));
    assert_int_equal(sdm_registry_load_path(registry, "test_abi_copies", &err), SDM_OK);
    assert_int_equal(sdm_registry_count(registry), 1);
    assert_non_null(
        strstr(sdm_registry_skipped(registry, 0), "test_abi_copies/other.so: shape 'oc"));
    assert_null(sdm_registry_skipped(registry, 1));
    remove("test_abi_copies/link.so");
    remove("test_abi_copies/copy.so");
    remove("test_abi_copies/other.so");
    rmdir("test_abi_copies");
}

// Files of a folder are loaded in alphabetical order, those that cannot be loaded are skipped;
// files that do not end in .so are ignored.
static void test_folder_is_loaded_in_order(void **state)
{
    (void)state;
    mkdir("test_abi_folder", 0777);
    file_write("test_abi_folder/b.so", "b", 1);
    file_write("test_abi_folder/a.so", "a", 1);
    file_write("test_abi_folder/readme.txt", "c", 1);
    assert_int_equal(sdm_registry_load_path(registry, "test_abi_folder", &err), SDM_OK);
    assert_non_null(strstr(sdm_registry_skipped(registry, 0), "folder/a.so cannot be loaded"));
    assert_non_null(strstr(sdm_registry_skipped(registry, 1), "folder/b.so cannot be loaded"));
    assert_null(sdm_registry_skipped(registry, 2));
    assert_null(sdm_registry_skipped(NULL, 0));
    remove("test_abi_folder/a.so");
    remove("test_abi_folder/b.so");
    assert_int_equal(sdm_registry_load_path(registry, "test_abi_folder", &err), SDM_OK);
    remove("test_abi_folder/readme.txt");
    rmdir("test_abi_folder");
}

int main(void)
{
#define WITH_REGISTRY(test) cmocka_unit_test_setup_teardown(test, set_up, tear_down)
    const struct CMUnitTest tests[] = {
        WITH_REGISTRY(test_table_of_version_1_is_accepted),
        WITH_REGISTRY(test_distributions_are_read),
        WITH_REGISTRY(test_missing_members_count_as_null),
        WITH_REGISTRY(test_unknown_members_are_ignored),
        WITH_REGISTRY(test_other_interface_versions_are_refused),
        WITH_REGISTRY(test_bad_plugins_are_refused),
        WITH_REGISTRY(test_other_files_are_refused),
        WITH_REGISTRY(test_example_plugin_works),
        WITH_REGISTRY(test_same_file_is_loaded_once),
        WITH_REGISTRY(test_folder_is_loaded_in_order),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
