/* The measures of plug-ins: what is refused at registration, and checks around the callback.
 * Tests: mesh_measures.c shape_check.c shape_measure.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/registry.h"

static const sdm_param PARAMS[] = {{"size", "mm", 1, 3, 2, "edge"}};
static const sdm_option OPTIONS[] = {
    {"mode", SDM_OPTION_CHOICE, "", 0, 0, 0, "good|nan|infinite|error|mute|open", "x"}};

/* A tetrahedron with three edges of the length `size` along the axes. */
static int mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                const double *p, sdm_mesh_out *out)
{
    (void)self;
    static const uint32_t TRI[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    const int failed = host->reserve(host, out, 4, strcmp(options[0].text, "open") ? 4 : 3);
    if (failed) return failed;
    for (int i = 0; i < 12; i++) out->vert[i] = 0;
    for (int k = 0; k < 3; k++) out->vert[3 * (k + 1) + k] = p[0];
    memcpy(out->tri, TRI, 3 * out->n_tri * sizeof *TRI);
    return 0;
}

static int measure(const void *self, const sdm_host *host, const sdm_option_value *options,
                   const double *p, uint32_t index, double depth, double *value)
{
    (void)self;
    const char *mode = options[0].text;
    if (!strcmp(mode, "error")) return (host->fail)(host, "no ruler");
    if (!strcmp(mode, "mute")) return 7;
    *value = index ? depth * p[0] : p[0] + depth;
    if (!strcmp(mode, "nan")) *value = NAN;
    if (!strcmp(mode, "infinite") && index) *value = INFINITY;
    return 0;
}

static const sdm_measure MEASURES[] = {{"edge", "mm", "x", 0}, {"slope", "mm^2", "y", 1}};
static const sdm_shape GOOD = {.abi = SDM_SHAPE_ABI,
                               .size = sizeof(sdm_shape),
                               .name = "tetra",
                               .summary = "test",
                               .params = PARAMS,
                               .n_params = 1,
                               .options = OPTIONS,
                               .n_options = 1,
                               .mesh = mesh,
                               .measures = MEASURES,
                               .n_measures = 2,
                               .measure = measure};

static sdm_error err;

static void err_has(const char *text)
{
    if (!strstr(err.text, text)) fail_msg("'%s' is not in '%s'", text, err.text);
}

static void refused(const sdm_shape *shape, const char *text)
{
    sdm_registry *r = NULL;
    assert_int_equal(sdm_registry_create(&r, NULL), SDM_OK);
    assert_int_equal(sdm_registry_add(r, shape, "there", &err), SDM_E_PLUGIN);
    err_has("there: shape 'tetra': ");
    err_has(text);
    sdm_registry_free(r);
}

static void test_registration(void **state)
{
    (void)state;
    static const struct {
        sdm_measure second;
        const char *text;
    } BAD[] = {{{"Edge", "", "", 0}, "measure 2 has the name 'Edge'"},
               {{NULL, "", "", 0}, "measure 2 has the name '(none)'"},
               {{"edge", "", "", 0}, "two measures are named 'edge'"},
               {{"extent_y", "mm", "", 0}, "measure 'extent_y': every shape has it"},
               {{"slope", NULL, "", 0}, "measure 'slope' has no unit"},
               {{"slope", "", NULL, 0}, "measure 'slope' has no help"}};
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        const sdm_measure measures[2] = {MEASURES[0], BAD[i].second};
        sdm_shape s = GOOD;
        s.measures = measures;
        refused(&s, BAD[i].text);
    }
    sdm_shape s = GOOD;
    s.measure = NULL;
    refused(&s, "all or none");
    s = GOOD, s.n_measures = 0;
    refused(&s, "all or none");
    s = GOOD, s.measures = NULL;
    refused(&s, "all or none");
    s = GOOD, s.n_measures = 65;
    refused(&s, "65 measures, at most 64");
}

/* Measures a tetrahedron of this mode and edge. */
static sdm_status measured(const sdm_shape *shape, const char *mode, double edge,
                           const double *depths, size_t n, sdm_measures *out)
{
    sdm_registry *r = NULL;
    sdm_instance *s = NULL;
    assert_int_equal(sdm_registry_create(&r, NULL), SDM_OK);
    assert_int_equal(sdm_registry_add(r, shape, "there", NULL), SDM_OK);
    assert_int_equal(sdm_instance_create(sdm_registry_find(r, "tetra", NULL),
                                         &(sdm_named_text){"mode", mode}, 1, NULL, &s, NULL),
                     SDM_OK);
    const sdm_status status = sdm_shape_measure(s, &edge, depths, n, out, &err);
    sdm_instance_free(s);
    sdm_registry_free(r);
    if (status) assert_int_equal(out->n, 0);
    return status;
}

static void is(const sdm_measured *m, const char *name, double depth, double value)
{
    assert_string_equal(m->name, name);
    assert_true(isnan(depth) ? isnan(m->depth) : fabs(m->depth - depth) < 1e-15);
    assert_true(isnan(value) ? isnan(m->value) : fabs(m->value - value) < 1e-12);
    assert_true(isnan(m->sd));
    assert_false(m->not_determined);
}

static void test_values(void **state)
{
    (void)state;
    sdm_measures m;
    const double depths[2] = {3, 5};
    assert_int_equal(measured(&GOOD, "good", 2, depths, 2, &m), SDM_OK);
    assert_int_equal(m.n, 8);
    is(&m.at[0], "edge", NAN, 2);
    is(&m.at[1], "slope", 3, 6);
    is(&m.at[2], "slope", 5, 10);
    is(&m.at[3], "volume", NAN, 8. / 6);
    is(&m.at[4], "area", NAN, 6 + 2 * sqrt(3));
    for (size_t i = 5; i < 8; i++)
        is(&m.at[i], (const char *[]){"extent_x", "extent_y", "extent_z"}[i - 5], NAN, 2);
    assert_int_equal(measured(&GOOD, "good", 2, NULL, 0, &m), SDM_OK);
    assert_int_equal(m.n, 6);
    // an open mesh has no volume
    assert_int_equal(measured(&GOOD, "open", 2, NULL, 0, &m), SDM_OK);
    is(&m.at[1], "volume", NAN, NAN);
    is(&m.at[2], "area", NAN, 6);
    // a table of the time before measures
    sdm_shape old = GOOD;
    old.size = offsetof(sdm_shape, measures);
    assert_int_equal(measured(&old, "good", 2, NULL, 0, &m), SDM_OK);
    assert_int_equal(m.n, 5);
}

static void test_refusals(void **state)
{
    (void)state;
    sdm_measures m;
    const double bad[3] = {-1, NAN, INFINITY}, depth = 1;
    double many[SDM_MEASURES_MAX] = {0};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(measured(&GOOD, "good", 2, &bad[i], 1, &m), SDM_E_ARG);
        err_has("mm: need 0 or more");
    }
    assert_int_equal(measured(&GOOD, "good", 2, many, SDM_MEASURES_MAX, &m), SDM_E_ARG);
    err_has("more than 128 measures: take fewer depths");
    assert_int_equal(measured(&GOOD, "good", 2, many, SDM_MEASURES_MAX - 6, &m), SDM_OK);
    assert_int_equal(m.n, SDM_MEASURES_MAX);
    assert_int_equal(measured(&GOOD, "good", 4, NULL, 0, &m), SDM_E_RANGE);
    sdm_shape without = GOOD;
    without.n_measures = 1;
    assert_int_equal(measured(&without, "good", 2, &depth, 1, &m), SDM_E_ARG);
    err_has("shape 'tetra' has no measure of a depth");
    // the callback
    assert_int_equal(measured(&GOOD, "nan", 2, NULL, 0, &m), SDM_E_PLUGIN);
    err_has("shape 'tetra' at size=2: measure 'edge': measure() gives a number that is not finite");
    assert_int_equal(measured(&GOOD, "infinite", 2, &depth, 1, &m), SDM_E_PLUGIN);
    err_has("measure 'slope': measure() gives a number that is not finite");
    assert_int_equal(measured(&GOOD, "error", 2, NULL, 0, &m), SDM_E_PLUGIN);
    err_has("shape 'tetra' at size=2: measure 'edge': no ruler");
    assert_int_equal(measured(&GOOD, "mute", 2, NULL, 0, &m), SDM_E_PLUGIN);
    err_has("measure() returned 7 without a reason");
    assert_int_equal(sdm_shape_measure(NULL, NULL, NULL, 0, &m, NULL), SDM_E_ARG);
    assert_int_equal(sdm_shape_measure(NULL, NULL, NULL, 0, NULL, NULL), SDM_E_ARG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_registration),
                                       cmocka_unit_test(test_values),
                                       cmocka_unit_test(test_refusals)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
