/* The duct: at its defaults the cochlea of cochlea.c; sections and volumes against closed forms
 * that are written here; which parameters there are; its measures. Tests: duct.c duct_curve.c
 * cochlea_place.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "../../shapes/duct_curve.h"
#include "shape_tools.h"

#define PI 3.14159265358979323846

static const char *const FORMS[] = {"circle", "ellipse", "lobes"};

static void near_to(const char *what, double found, double want, double bound)
{
    if (!(fabs(found - want) <= bound)) fail_msg("%s is %.9g, not %.9g", what, found, want);
}

static double measure_of(const sdm_instance *s, const double *p, const char *name)
{
    sdm_error err = {0};
    sdm_measures m;
    if (sdm_shape_measure(s, p, NULL, 0, &m, &err)) fail_msg("%s", err.text);
    for (size_t i = 0; i < m.n; i++)
        if (!strcmp(m.at[i].name, name)) return m.at[i].value;
    fail_msg("no measure '%s'", name);
    return NAN;
}

static void defaults_of(const sdm_instance *s, double *p)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    for (size_t i = 0; i < n; i++) p[i] = params[i].def;
}

/* All forms at their defaults have the vertices and measures of the cochlea with the same published
 * parameters, for both ears. */
static void test_is_the_cochlea(void **state)
{
    (void)state;
    static const char *const MEASURES[] = {"diameter_a",  "diameter_b", "height", "length_centre",
                                           "length_wall", "turns",      "volume"};
    for (int round = 0; round < 6; round++) {
        char text[64];
        const char *ear = round % 2 ? "left" : "right";
        snprintf(text, sizeof text, "edge=0.4 ear=%s", ear);
        sdm_instance *cochlea = shape_make("cochlea", text);
        snprintf(text, sizeof text, "edge=0.4 ear=%s section=%s", ear, FORMS[round / 2]);
        sdm_instance *duct = shape_make("duct", text);
        double p[DUCT_ALL], q[4];
        defaults_of(duct, p);
        random_params(cochlea, q);
        memcpy(p, q, sizeof q);
        sdm_mesh a = {0}, b = {0};
        mesh_at(cochlea, q, &a);
        mesh_at(duct, p, &b);
        assert_int_equal(a.n_vert, b.n_vert);
        assert_int_equal(a.n_tri, b.n_tri);
        for (size_t i = 0; i < 3 * a.n_vert; i++) near_to("a vertex", b.vert[i], a.vert[i], 1e-12);
        assert_memory_equal(a.tri, b.tri, 3 * a.n_tri * sizeof *a.tri);
        for (size_t i = 0; i < sizeof MEASURES / sizeof *MEASURES; i++) {
            const double want = measure_of(cochlea, q, MEASURES[i]);
            near_to(MEASURES[i], measure_of(duct, p, MEASURES[i]), want, 1e-6 * want);
        }
        sdm_mesh_dispose(&a);
        sdm_mesh_dispose(&b);
        sdm_instance_free(cochlea);
        sdm_instance_free(duct);
    }
}

static void test_sections(void **state)
{
    (void)state;
    for (int round = 0; round < 20; round++) {
        const double w = random_in(0.5, 1.7), h = random_in(0.4, 1.5), tilt = random_in(-1, 1),
                     waist = random_in(-0.2, 0.5), egg = round % 2 ? random_in(-0.4, 0.4) : 0;
        const duct_section s = {
            .wide = w, .high = h, .tilt = {cos(tilt), sin(tilt)}, .waist = waist, .egg = egg};
        double last[2], now[2], area = 0, wide = 0, high = 0;
        sdm_duct_outline_at(&s, 1, 0, last);
        for (int i = 1; i <= 20000; i++) {
            const double v = 2 * PI * i / 20000;
            sdm_duct_outline_at(&s, cos(v), sin(v), now);
            area += 0.5 * (last[0] * now[1] - last[1] * now[0]);
            wide = fmax(wide, cos(tilt) * now[0] + sin(tilt) * now[1]);
            high = fmax(high, cos(tilt) * now[1] - sin(tilt) * now[0]);
            memcpy(last, now, sizeof last);
        }
        near_to("the area", area, PI * w * h * (1 - 0.75 * waist), 1e-6);
        near_to("the height", high, h, 1e-6);
        const double along[2] = {s.tilt[0], s.tilt[1]}, across[2] = {-s.tilt[1], s.tilt[0]};
        near_to("the reach along the width", sdm_duct_reach(&s, along), wide, 1e-4);
        near_to("the reach along the height", sdm_duct_reach(&s, across), h, 1e-4);
        if (round % 2) continue;
        // without an egg the width has a closed form: two lobes above a waist of 1/3
        const double want = waist > 1. / 3 ? w * 2 / (3 * sqrt(3 * waist)) : w * (1 - waist);
        near_to("the width", wide, want, 1e-6);
    }
}

/* Two turns that do not touch, sections with their middle on the centreline: the volume is the
 * integral of the area along the centreline (Pappus), here by Simpson's rule from the equations in
 * duct.c, and two half-ellipsoids. */
static void test_volume(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("duct", "edge=0.1 section=lobes");
    const double a = 5, b = 0.06, c = 0.3, end = 12.3, dome = 0.2, hook = 0.7, dip = -0.4;
    const double W[3] = {1.5, 1.2, 0.8}, H[3] = {1.7, 1.1, 0.9}, flare = 0.1, cap = 1.5, tip = 0.7,
                 waist = 0.4;
    const double p[DUCT_ALL] = {a,    0,    b,    0,     c,   end, dome, hook, dip,
                                W[0], W[1], W[2], flare, cap, tip, H[0], H[1], H[2],
                                -0.6, 0.1,  0.3,  waist, 0,   0.8, -0.7};
    enum { STEPS = 20000 };
    double volume = 0, area[2] = {0}, mean[2] = {0};
    for (int i = 0; i <= STEPS; i++) {
        const double f = (double)i / STEPS, t = f * end, e = exp(-b * t),
                     u = fmax(0, 1 - 2 * t / PI), r = a * e + hook * u * u * u,
                     dr = -a * b * e - 3 * hook * u * u * 2 / PI,
                     dz = c + 4 * dome * (1 - 2 * f) / end - 3 * dip * u * u * 2 / PI,
                     speed = sqrt(dr * dr + r * r + dz * dz);
        const double l0 = (1 - f) * (1 - 2 * f), l1 = 4 * f * (1 - f), l2 = f * (2 * f - 1),
                     late = fmax(0, 1 - (end - t) / PI), taper = 1 - (1 - tip) * late * late,
                     more = flare * exp(-t / 0.35);
        const double w = taper * ((W[0] * l0 + W[1] * l1 + W[2] * l2) / 2 + more),
                     h = taper * ((H[0] * l0 + H[1] * l1 + H[2] * l2) / 2 + more);
        const double now = PI * w * h * (1 - 0.75 * waist);
        volume += now * speed * (i == 0 || i == STEPS ? 1 : i % 2 ? 4 : 2) * end / STEPS / 3;
        if (i == 0) area[0] = now, mean[0] = sqrt(w * h);
        if (i == STEPS) area[1] = now, mean[1] = sqrt(w * h);
    }
    volume += 2. / 3 * (area[0] * mean[0] * cap + area[1] * mean[1]);
    const double found = measure_of(s, p, "volume");
    // the mesh is inscribed
    if (!(found < volume * 1.001 && found > volume * 0.98))
        fail_msg("the volume is %.6g, not %.6g", found, volume);
    sdm_instance_free(s);
}

static void test_parameters(void **state)
{
    (void)state;
    static const struct {
        const char *options, *last;
        size_t n;
    } CASES[] = {{"section=circle", "tip", 15},
                 {"", "tilt_apex", 21},
                 {"section=lobes", "slant_up", 25},
                 {"section=lobes free=paper", "phi", 4},
                 {"section=lobes free=centreline", "dip", 9},
                 {"section=lobes free=section", "slant_up", 20},
                 {"section=circle free=section", "tip", 10},
                 {"section=circle detail=1", "sway", 17},
                 {"detail=1", "twist", 25},
                 {"section=lobes detail=7", "oblique_7", 64}};
    for (size_t i = 0; i < sizeof CASES / sizeof *CASES; i++) {
        sdm_instance *s = shape_make("duct", CASES[i].options);
        size_t n;
        const sdm_param *params = sdm_instance_params(s, &n);
        assert_int_equal(n, CASES[i].n);
        assert_string_equal(params[0].name, "a");
        assert_string_equal(params[n - 1].name, CASES[i].last);
        sdm_instance_free(s);
    }
    // an option is the constant, or the default of a parameter
    sdm_instance *all = shape_make("duct", "edge=0.5 hook=0.6 height_base=1.6"),
                 *fixed = shape_make("duct", "edge=0.5 hook=0.6 height_base=1.6 free=paper");
    double p[DUCT_ALL];
    defaults_of(all, p);
    near_to("the hook", p[DUCT_HOOK], 0.6, 0);
    sdm_mesh a = {0}, b = {0};
    mesh_at(all, p, &a);
    mesh_at(fixed, p, &b);
    assert_memory_equal(a.vert, b.vert, 3 * a.n_vert * sizeof *a.vert);
    sdm_mesh_dispose(&a);
    sdm_mesh_dispose(&b);
    sdm_instance_free(all);
    sdm_instance_free(fixed);
}

static double along(const double *x, const double *from, const double axis[3])
{
    return (x[0] - from[0]) * axis[0] + (x[1] - from[1]) * axis[1] + (x[2] - from[2]) * axis[2];
}

/* A slanted duct: the vertices of the first section move along the tangent as the slopes state, and
 * those beyond the first quarter of a turn stay where they are. */
static void test_slant(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("duct", "edge=0.3 section=lobes");
    double p[DUCT_ALL] = {0};
    sdm_mesh plain = {0}, slanted = {0};
    duct_section base, quarter;
    defaults_of(s, p);
    mesh_at(s, p, &plain);
    sdm_duct_section_at(DUCT_LOBES, 0, p, 0, &base);
    sdm_duct_section_at(DUCT_LOBES, 0, p, 0.5 * PI / p[DUCT_THETA], &quarter);
    p[DUCT_SLANT_OUT] = 0.5, p[DUCT_SLANT_UP] = -0.8;
    mesh_at(s, p, &slanted);
    assert_int_equal(plain.n_vert, slanted.n_vert);
    size_t moved = 0, still = 0;
    for (size_t i = 0; i < plain.n_vert; i++) {
        const double *x = plain.vert + 3 * i, *y = slanted.vert + 3 * i;
        if (fabs(along(x, base.centre, base.tangent)) < 1e-9) {
            const double out = along(x, base.centre, base.e1), up = -along(x, base.centre, base.e2);
            if (hypot(out, up) > 2) continue; // a section of another turn
            near_to("the way along the tangent", along(y, x, base.tangent), 0.5 * out - 0.8 * up,
                    1e-9);
            near_to("the way outwards", along(y, x, base.e1), 0, 1e-9);
            moved++;
        }
        // in the plane of the quarter or just behind it
        const double behind = along(x, quarter.centre, quarter.tangent);
        if (behind > -1e-9 && behind < 1 && x[1] > 2) {
            near_to("the rest", along(y, x, base.tangent), 0, 0);
            still++;
        }
    }
    assert_true(moved > 10 && still > 10);
    sdm_mesh_dispose(&plain);
    sdm_mesh_dispose(&slanted);
    sdm_instance_free(s);
}

/* Inscribed meshes reach as high as the duct, and a little less, all over the ranges. */
static void test_height(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("duct", "edge=0.1 section=lobes");
    for (int i = 0; i < 3; i++) {
        double p[DUCT_ALL];
        random_params(s, p);
        const double height = measure_of(s, p, "height"), found = measure_of(s, p, "extent_z");
        if (!(found <= height * (1 + 1e-6) && found > height * 0.99))
            fail_msg("the mesh is %.6g mm high, the duct %.6g", found, height);
    }
    sdm_instance_free(s);
}

static size_t index_of(const sdm_instance *s, const char *name)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    for (size_t i = 0; i < n; i++)
        if (!strcmp(params[i].name, name)) return i;
    fail_msg("no parameter '%s'", name);
    return 0;
}

/* Growth that is the same at all control values is the same along all turns: the outline is that of
 * the shape without details times the factor in duct.c. Four control values: a cubic polynomial,
 * here in Bernstein's form. */
static void test_growth(void **state)
{
    (void)state;
    double x[DUCT_ALL] = {4.4, 0.5, 0.145, 0.4, 0.2, 14.5, 0,   0, 0, 2.2, 1.9,
                          1.6, 0.2, 1,     1,   2.1, 1.8,  1.5, 0, 0, 0,   0.2};
    duct_section plain, grown;
    for (size_t n = 1; n <= DUCT_VALUES_MAX; n++) {
        for (size_t i = 0; i < n; i++) {
            const double log_growth[DUCT_HARMONICS] = {0.1, 0.05, -0.2, 0.15, 0.3};
            for (size_t k = 0; k < DUCT_HARMONICS; k++) x[DUCT_VALUES + k * n + i] = log_growth[k];
        }
        for (int round = 0; round <= 10; round++) {
            const double v = random_in(0, 2 * PI), co = cos(v), up = sin(v);
            double a[2], b[2];
            sdm_duct_section_at(DUCT_LOBES, 0, x, round / 10., &plain);
            sdm_duct_section_at(DUCT_LOBES, n, x, round / 10., &grown);
            sdm_duct_outline_at(&plain, co, -up, a); // e2 points down
            sdm_duct_outline_at(&grown, co, -up, b);
            const double want =
                exp(0.1 + 0.05 * co - 0.2 * up + 0.15 * cos(2 * v) + 0.3 * sin(2 * v));
            near_to("the width", b[0], want * a[0], 1e-12);
            near_to("the height", b[1], want * a[1], 1e-12);
            near_to("the mean radius", sdm_duct_mean_radius(&grown),
                    exp(0.1) * sdm_duct_mean_radius(&plain), 1e-12);
        }
    }
    const double v[4] = {0.1, -0.2, 0.3, 0.05};
    memcpy(x + DUCT_VALUES, v, sizeof v);
    for (int i = 0; i <= 10; i++) {
        const double f = i / 10., g = 1 - f;
        sdm_duct_section_at(DUCT_LOBES, 4, x, f, &grown);
        near_to("the spline", grown.growth[DUCT_GROWTH_SIZE],
                v[0] * g * g * g + 3 * v[1] * f * g * g + 3 * v[2] * f * f * g + v[3] * f * f * f,
                1e-15);
    }
    // two pieces: continuous with two derivatives at their border
    double at[7];
    const double h = 1e-3, w[5] = {0.1, -0.2, 0.3, 0.05, -0.3};
    memcpy(x + DUCT_VALUES, w, sizeof w);
    for (int i = 0; i < 7; i++) {
        sdm_duct_section_at(DUCT_LOBES, 5, x, 0.5 + (i - 3) * h, &grown);
        at[i] = grown.growth[DUCT_GROWTH_SIZE];
    }
    near_to("the spline in the middle", at[3], (w[1] + 2 * w[2] + w[3]) / 4, 1e-15);
    near_to("its slope", (at[3] - at[2]) / h, (at[4] - at[3]) / h, 50 * h);
    near_to("its curvature", (at[3] - 2 * at[2] + at[1]) / (h * h),
            (at[5] - 2 * at[4] + at[3]) / (h * h), 500 * h);
}

/* The second wave, the higher flare and the twist, against the formulas in duct.c; the control
 * values have a normal distribution, all else a uniform one. */
static void test_details(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("duct", "section=lobes detail=2");
    double p[DUCT_ALL];
    defaults_of(s, p);
    const size_t n_values = 2;
    duct_section a, b;
    sdm_duct_section_at(DUCT_LOBES, n_values, p, 0.03, &a);
    p[index_of(s, "surge")] = 0.3, p[index_of(s, "sway")] = -0.5;
    p[index_of(s, "flare_high")] = 0.2, p[index_of(s, "twist")] = 0.7;
    sdm_duct_section_at(DUCT_LOBES, n_values, p, 0.03, &b);
    const double t = 0.03 * p[DUCT_THETA], u = 1 - 2 * t / PI;
    near_to("the wave", b.centre[2] - a.centre[2], exp(-0.3 * t) * (0.3 * cos(t) - 0.5 * sin(t)),
            1e-12);
    near_to("the height", b.high - a.high, 0.2 * exp(-t / 0.35), 1e-12);
    near_to("the width", b.wide, a.wide, 0);
    near_to("the tilt", atan2(-b.tilt[1], b.tilt[0]) - atan2(-a.tilt[1], a.tilt[0]), 0.7 * u * u,
            1e-12);
    const double h = 1e-5; // the frame follows the derivatives of the centreline
    duct_section before, after;
    sdm_duct_section_at(DUCT_LOBES, n_values, p, 0.03 - h, &before);
    sdm_duct_section_at(DUCT_LOBES, n_values, p, 0.03 + h, &after);
    double way[3], length = 0;
    for (int k = 0; k < 3; k++) way[k] = after.centre[k] - before.centre[k];
    length = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
    double turn = 0, step = length / 2;
    for (int k = 0; k < 3; k++) {
        near_to("the tangent", b.tangent[k], way[k] / length, 1e-8);
        turn += (after.tangent[k] - before.tangent[k]) / (2 * step) * b.e2[k];
    }
    near_to("the curvature", b.bend[1], turn, 1e-6);
    size_t n, normal = 0;
    sdm_instance_params(s, &n);
    const sdm_distribution *d = sdm_instance_distributions(s);
    for (size_t i = 0; i < n; i++) normal += d[i].kind == SDM_DISTRIBUTION_NORMAL;
    assert_int_equal(normal, n_values * DUCT_HARMONICS);
    assert_int_equal(d[n - 1].kind, SDM_DISTRIBUTION_NORMAL);
    sdm_instance_free(s);
}

/* A height whose flare is longer than itself, negative: the section stays thin, and the mesh
 * closed. */
static void test_flare_beyond_the_height(void **state)
{
    (void)state;
    sdm_error err = {0};
    sdm_instance *s = shape_make("duct", "section=lobes detail=2");
    double p[DUCT_ALL];
    defaults_of(s, p);
    p[index_of(s, "height_base")] = 1.2;
    p[index_of(s, "flare")] = -0.3, p[index_of(s, "flare_high")] = -0.4;
    duct_section base;
    sdm_duct_section_at(DUCT_LOBES, 2, p, 0, &base);
    near_to("the half axis", base.high, 0.1 * exp(-0.1 / 0.1 - 1), 1e-12);
    sdm_mesh m = {0};
    sdm_audit audit;
    if (sdm_instance_mesh(s, p, &m, &err)) fail_msg("%s", err.text);
    assert_int_equal(sdm_mesh_audit(&m, &audit, &err), SDM_OK);
    assert_true(audit.closed);
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_is_the_cochlea),
        cmocka_unit_test(test_sections),
        cmocka_unit_test(test_volume),
        cmocka_unit_test(test_parameters),
        cmocka_unit_test(test_slant),
        cmocka_unit_test(test_height),
        cmocka_unit_test(test_growth),
        cmocka_unit_test(test_details),
        cmocka_unit_test(test_flare_beyond_the_height),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
