/* Measures of shapes: volume, area and extents against closed forms; those of the cochlea against
 * chords of curves that are written here from the equations of the model, and against meshes.
 * Tests: cochlea_measure.c shape_measure.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "shape_tools.h"

#define PI 3.14159265358979323846

static sdm_measures measure_at(const sdm_instance *s, const double *p, const double *depths,
                               size_t n_depths)
{
    sdm_error err = {0};
    sdm_measures m;
    if (sdm_shape_measure(s, p, depths, n_depths, &m, &err)) fail_msg("%s", err.text);
    return m;
}

static const sdm_measured *find(const sdm_measures *m, const char *name, double depth)
{
    for (size_t i = 0; i < m->n; i++)
        if (!strcmp(m->at[i].name, name) && (isnan(depth) || !(fabs(m->at[i].depth - depth) > 0)))
            return &m->at[i];
    fail_msg("no measure '%s'", name);
    return NULL;
}

static double value_of(const sdm_measures *m, const char *name)
{
    const sdm_measured *x = sdm_measures_find(m, name);
    if (!x) fail_msg("no measure '%s'", name);
    assert_null(sdm_measures_find(m, "weight"));
    return x->value;
}

static void near_to(const char *what, double found, double want, double bound)
{
    if (!(fabs(found - want) <= bound)) fail_msg("%s is %.9g, not %.9g", what, found, want);
}

/* The mesh is inscribed: its measures are smaller by up to the share `most`. */
static void inscribed(const char *what, double found, double want, double most)
{
    if (!(found <= want * (1 + 1e-12) && found > want * (1 - most)))
        fail_msg("%s is %.9g, not %.9g or a little less", what, found, want);
}

static void test_closed_forms(void **state)
{
    (void)state;
    // torus: Pappus
    const double torus[2] = {3.5, 0.8}, R = torus[0], r = torus[1];
    sdm_instance *s = shape_make("torus", "edge=0.05");
    sdm_measures m = measure_at(s, torus, NULL, 0);
    assert_int_equal(m.n, 5);
    inscribed("volume", value_of(&m, "volume"), 2 * PI * PI * R * r * r, 2e-3);
    inscribed("area", value_of(&m, "area"), 4 * PI * PI * R * r, 1e-3);
    inscribed("extent_x", value_of(&m, "extent_x"), 2 * (R + r), 1e-3);
    inscribed("extent_y", value_of(&m, "extent_y"), 2 * (R + r), 1e-3);
    inscribed("extent_z", value_of(&m, "extent_z"), 2 * r, 1e-3);
    assert_string_equal(find(&m, "volume", NAN)->unit, "mm^3");
    assert_true(isnan(find(&m, "volume", NAN)->depth) && isnan(find(&m, "volume", NAN)->sd));
    sdm_instance_free(s);
    // oblate spheroid
    const double spheroid[3] = {3, 3, 1.5}, e = sqrt(1 - 0.25);
    s = shape_make("ellipsoid", "edge=0.1");
    m = measure_at(s, spheroid, NULL, 0);
    inscribed("volume", value_of(&m, "volume"), 4 * PI / 3 * 3 * 3 * 1.5, 3e-3);
    inscribed("area", value_of(&m, "area"), 2 * PI * 9 * (1 + 0.25 / e * atanh(e)), 2e-3);
    inscribed("extent_z", value_of(&m, "extent_z"), 3, 1e-9);
    sdm_instance_free(s);
    // capsule
    const double capsule[2] = {1.2, 5};
    s = shape_make("capsule", "edge=0.05");
    m = measure_at(s, capsule, NULL, 0);
    inscribed("volume", value_of(&m, "volume"), PI * 1.44 * (5 + 4 * 1.2 / 3), 2e-3);
    inscribed("area", value_of(&m, "area"), 2 * PI * 1.2 * (5 + 2 * 1.2), 1e-3);
    sdm_instance_free(s);
}

/* The cochlea overlaps itself at a = 2: its volume is that of the union, here counted by points of
 * a grid inside the closed form. */
static void test_volume_of_the_union(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("cochlea", "edge=0.15");
    const double p[4] = {2, 0.5, 0.2, 0.4}, h = 0.2;
    const sdm_measures m = measure_at(s, p, NULL, 0);
    double volume = 0, x[3];
    for (x[2] = -2; x[2] < 5; x[2] += h)
        for (x[1] = -4; x[1] < 4; x[1] += h)
            for (x[0] = -4; x[0] < 4; x[0] += h) volume += h * h * h * (distance_at(s, p, x) < 0);
    inscribed("volume", value_of(&m, "volume"), 1.005 * volume, 0.025);
    sdm_instance_free(s);
}

/* ---- the cochlea, from its equations ---- */

typedef struct ear {
    double a, alpha, b, phi;
    bool cubic; // polynomial start: r(0) = 5.3 mm, joined with the spiral at pi/2 up to r''
} ear;

static const double END = 14.5, JOIN = PI / 2;

/* r[2] = radius of the centreline and its derivative. */
static void spiral(const ear *c, double theta, double r[2])
{
    r[0] = c->a * exp(-c->b * theta);
    r[1] = -c->b * r[0];
    if (!c->cubic || theta >= JOIN) return;
    const double s = c->a * exp(-c->b * JOIN), ds = -c->b * s, dds = c->b * c->b * s;
    const double k = (s - ds * JOIN + dds * JOIN * JOIN / 2 - 5.3) / (JOIN * JOIN * JOIN),
                 t = theta - JOIN;
    r[0] = s + ds * t + dds * t * t / 2 + k * t * t * t;
    r[1] = ds + dds * t + 3 * k * t * t;
}

/* Point of the centreline, and of the lateral wall: one tube radius outward along the horizontal
 * normal. */
static void points_at(const ear *c, double theta, double centre[3], double wall[3])
{
    double r[2];
    spiral(c, theta, r);
    const double co = cos(theta), si = sin(theta);
    centre[0] = r[0] * co;
    centre[1] = r[0] * si;
    centre[2] = 0.2 * theta + c->alpha * exp(-0.3 * theta) * cos(theta - c->phi);
    const double tx = r[1] * co - r[0] * si, ty = r[1] * si + r[0] * co, level = hypot(tx, ty),
                 radius = 1.11 - 0.02 * theta + 0.25 * exp(-theta / 0.35);
    wall[0] = centre[0] + radius * ty / level;
    wall[1] = centre[1] - radius * tx / level;
    wall[2] = centre[2];
}

static double distance_between(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

enum { STEPS = 200000 };
typedef struct expected {
    double a, b, length_centre, length_wall;
    double angle[3]; // at DEPTH, degrees
} expected;
static const double DEPTH[3] = {0, 7.5, 20};

/* Walks along both curves. */
static expected walk(const ear *c)
{
    expected e = {0};
    double centre[2][3], wall[2][3];
    points_at(c, 0, centre[0], wall[0]);
    const double first = atan2(wall[0][1], wall[0][0]);
    double angle = first, away = hypot(wall[0][0], wall[0][1]);
    double radius[4] = {0}; // of the wall at each quarter of a turn
    for (int i = 1; i <= STEPS; i++) {
        points_at(c, END * i / STEPS, centre[1], wall[1]);
        const double next_away = hypot(wall[1][0], wall[1][1]),
                     turn = asin((wall[0][0] * wall[1][1] - wall[0][1] * wall[1][0]) /
                                 (away * next_away)),
                     chord = distance_between(wall[0], wall[1]);
        for (int q = 0; q < 4; q++)
            if (angle < q * PI / 2 && angle + turn >= q * PI / 2) radius[q] = next_away;
        for (int k = 0; k < 3; k++)
            if (e.length_wall <= DEPTH[k] && e.length_wall + chord > DEPTH[k])
                e.angle[k] = (angle + turn * (DEPTH[k] - e.length_wall) / chord - first) * 180 / PI;
        e.length_wall += chord;
        e.length_centre += distance_between(centre[0], centre[1]);
        angle += turn, away = next_away;
        memcpy(centre[0], centre[1], sizeof centre[0]);
        memcpy(wall[0], wall[1], sizeof wall[0]);
    }
    points_at(c, 0, centre[0], wall[0]);
    e.a = hypot(centre[0][0], centre[0][1]) + radius[2];
    e.b = radius[1] + radius[3];
    return e;
}

static void check_cochlea(const sdm_instance *s, const ear *c)
{
    const double p[4] = {c->a, c->alpha, c->b, c->phi};
    const sdm_measures m = measure_at(s, p, DEPTH, 3);
    const expected e = walk(c);
    near_to("diameter_a", value_of(&m, "diameter_a"), e.a, 2e-4);
    near_to("diameter_b", value_of(&m, "diameter_b"), e.b, 2e-4);
    near_to("length_centre", value_of(&m, "length_centre"), e.length_centre,
            1e-5 * e.length_centre);
    near_to("length_wall", value_of(&m, "length_wall"), e.length_wall, 1e-5 * e.length_wall);
    near_to("turns", value_of(&m, "turns"), END / (2 * PI), 1e-12);
    for (int k = 0; k < 3; k++) {
        near_to("insertion_angle", find(&m, "insertion_angle", DEPTH[k])->value, e.angle[k], 0.01);
        const double x = 1 - DEPTH[k] / e.length_wall;
        near_to("frequency", find(&m, "frequency", DEPTH[k])->value,
                165.4 * (exp(2.1 * x * log(10)) - 0.88), 0.3);
    }
}

static void test_cochlea(void **state)
{
    (void)state;
    sdm_instance *s[2] = {shape_make("cochlea", "edge=1"),
                          shape_make("cochlea", "edge=1 start=cubic")};
    for (int i = 0; i < 8; i++) {
        double p[4];
        random_params(s[0], p);
        if (i == 0) p[0] = 2, p[2] = 0.25;
        const ear c = {p[0], p[1], p[2], p[3], i % 2 == 1};
        check_cochlea(s[c.cubic], &c);
    }
    sdm_instance_free(s[0]);
    sdm_instance_free(s[1]);
}

/* Both ears measure the same; a fine mesh is as high as the tube, round or not. */
static void test_height_and_mirror(void **state)
{
    (void)state;
    static const char *const OPTIONS[] = {"edge=0.06", "edge=0.06 ear=left",
                                          "edge=0.06 section=ellipse ratio=0.5"};
    double first = 0;
    static const double P[2][4] = {{4.4, 1.1, 0.145, 0.4}, {2.3, 0.1, 0.23, -0.7}};
    for (int round = 0; round < 2; round++)
        for (int i = 0; i < 3; i++) {
            sdm_instance *s = shape_make("cochlea", OPTIONS[i]);
            const sdm_measures m = measure_at(s, P[round], NULL, 0);
            const double height = value_of(&m, "height");
            inscribed("height", value_of(&m, "extent_z"), height, 1e-3);
            if (i == 0) first = height;
            if (i == 1) assert_true(!(height < first) && !(height > first));
            if (i == 2) assert_true(height < first + 1e-9);
            sdm_instance_free(s);
        }
}

static void test_beyond_the_end(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("cochlea", "edge=1");
    const double p[4] = {2, 0, 0.25, 0};
    const sdm_measures all = measure_at(s, p, NULL, 0);
    const double end = value_of(&all, "length_wall"), depths[2] = {end, end + 1e-6};
    assert_int_equal(all.n, 6 + 5);
    const sdm_measures m = measure_at(s, p, depths, 2);
    assert_int_equal(m.n, 6 + 4 + 5);
    near_to("frequency at the apex", find(&m, "frequency", end)->value, 165.4 * 0.12, 1e-6);
    assert_true(isnan(find(&m, "frequency", depths[1])->value));
    assert_true(isnan(find(&m, "insertion_angle", depths[1])->value));
    // names alone
    sdm_measures names;
    assert_int_equal(sdm_shape_measure(s, NULL, NULL, 0, &names, NULL), SDM_OK);
    assert_int_equal(names.n, all.n);
    for (size_t i = 0; i < names.n; i++) {
        assert_string_equal(names.at[i].name, all.at[i].name);
        assert_true(isnan(names.at[i].value));
    }
    sdm_instance_free(s);
    // too short for its diameters
    sdm_error err = {0};
    s = shape_make("cochlea", "theta=4.7");
    assert_int_equal(sdm_shape_measure(s, p, NULL, 0, &names, &err), SDM_E_PLUGIN);
    assert_non_null(strstr(err.text, "shape 'cochlea' at a=2 "));
    assert_non_null(strstr(err.text, "measure 'diameter_a': the diameters need three quarters"));
    assert_int_equal(names.n, 0);
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_forms),   cmocka_unit_test(test_volume_of_the_union),
        cmocka_unit_test(test_cochlea),        cmocka_unit_test(test_height_and_mirror),
        cmocka_unit_test(test_beyond_the_end),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
