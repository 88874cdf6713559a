/* Surveys of shapes with one angle: in degrees where mesh() wants rad, in rad where it wants
 * degrees, and with factors that are right. Tests: survey_pole.c survey_scale.c survey_swing.c
 * mesh_turn.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "faulty_shape.h"
#include "sdm/internal/shape_survey.h"
#include "sdm/registry.h"

static sdm_error err;

/* What swinging_mesh() makes of an angle in rad. */
static double wave(const char *function, double angle)
{
    if (!strcmp(function, "tan")) return tan(angle);
    if (!strcmp(function, "half")) return tan(0.5 * angle);
    if (!strcmp(function, "secant")) return 1 / cos(angle);
    if (!strcmp(function, "steep")) return exp(0.5 * angle);
    if (!strcmp(function, "saw")) return angle - floor(angle);
    return sin(angle);
}

/* A body and a handle that goes up and down with a function of the parameter times the factor. */
static int swinging_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                         const double *p, sdm_mesh_out *out)
{
    (void)self;
    const int failed = host->reserve(host, out, 16, 24);
    if (failed) return failed;
    const double z = wave(options[1].text, p[0] * options[0].number);
    faulty_box(out, 0, (const double[3]){-2, -2, -2}, (const double[3]){2, 2, 2}, 0);
    faulty_box(out, 1, (const double[3]){1, -1, z - 0.5}, (const double[3]){4, 1, z + 0.5}, 0);
    // the vertices of a twisted bar: the last one turns by the whole angle
    for (int i = 0; i < 8 && !strcmp(options[1].text, "twist"); i++)
        out->vert[3 * (8 + i) + 2] += sin(p[0] * options[0].number * (i + 1) / 8) - z;
    return 0;
}

/* A body, and a handle that the parameter times the factor turns about the z axis (rigid), or whose
 * end alone it lifts as it opens a cone (cone). */
static int turning_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                        const double *p, sdm_mesh_out *out)
{
    (void)self;
    const int failed = host->reserve(host, out, 16, 24);
    if (failed) return failed;
    const double angle = p[0] * options[0].number, c = cos(angle), s = sin(angle);
    faulty_box(out, 0, (const double[3]){-2, -2, -2}, (const double[3]){2, 2, 2}, 0);
    faulty_box(out, 1, (const double[3]){1, -1, -1}, (const double[3]){4, 1, 1}, 0);
    for (int i = 0; i < 8; i++) {
        double *x = out->vert + 24 + 3 * i;
        const double at[3] = {x[0], x[1], x[2]};
        if (!strcmp(options[1].text, "rigid"))
            x[0] = c * at[0] - s * at[1], x[1] = s * at[0] + c * at[1];
        else if (at[0] > 2)
            x[0] = 1 + 3 * c, x[1] = at[1] * (1 + 3 * s), x[2] = at[2] * (1 + 3 * s);
    }
    return 0;
}

/* A brief survey of the swinging shape with one parameter, which is multiplied by the factor. */
static sdm_shape_survey survey_swinging(sdm_param param, const char *function, const char *factor)
{
    static const sdm_option options[] = {{"factor", SDM_OPTION_REAL, "", 0, 500, 1, NULL, "x"},
                                         {"function", SDM_OPTION_CHOICE, "", 0, 0, 0,
                                          "sin|tan|half|secant|steep|saw|twist|rigid|cone", "x"}};
    const sdm_shape shape = {.abi = SDM_SHAPE_ABI,
                             .size = sizeof(sdm_shape),
                             .name = "swinging",
                             .summary = "test",
                             .params = &param,
                             .n_params = 1,
                             SDM_OPTIONS(options),
                             .mesh = !strcmp(function, "rigid") || !strcmp(function, "cone")
                                         ? turning_mesh
                                         : swinging_mesh};
    const sdm_named_text given[] = {{"factor", factor}, {"function", function}};
    sdm_instance *instance = NULL;
    sdm_shape_survey s;
    if (sdm_instance_create(&shape, given, 2, NULL, &instance, &err) ||
        sdm_shape_survey_make(instance, &(sdm_survey_opts){.brief = true}, &s, &err))
        fail_msg("%s", err.text);
    sdm_instance_free(instance);
    return s;
}

static const char *const ANGLE_UNITS[] = {"deg", "rad", ""};

// An angle in rad that mesh() converts as if it were in degrees moves the shape of 6 mm by 0.017 mm
// per rad; without that, by 1 mm.
static void rad_that_are_converted(void **state)
{
    (void)state;
    for (int converted = 0; converted < 2; converted++) {
        sdm_shape_survey s = survey_swinging((sdm_param){"angle", "rad", 0.1, 0.7, 0.3, "x"}, "sin",
                                             converted ? "0.017453" : "1");
        assert_int_equal(s.slow, converted);
        assert_int_equal(sdm_shape_survey_verdict(&s), converted ? SDM_E_QUALITY : SDM_OK);
        sdm_shape_survey_dispose(&s);
        // a parameter without a unit may be one that hardly counts
        s = survey_swinging((sdm_param){"share", "", 0.1, 0.7, 0.3, "x"}, "sin", "0.017453");
        assert_int_equal(s.slow, 0);
        sdm_shape_survey_dispose(&s);
    }
}

// An angle in degrees that goes to sin() as it is, and one that is converted.
static void degrees_that_go_to_sin(void **state)
{
    (void)state;
    for (size_t i = 0; i < 6; i++) {
        sdm_shape_survey s =
            survey_swinging((sdm_param){"angle", ANGLE_UNITS[i / 2], -30, 60, 10, "x"}, "sin",
                            i % 2 ? "0.017453" : "1");
        // from -30 to 60 rad sin() turns back at 28 or 29 multiples of pi
        assert_true(i % 2 ? s.scale.swings == 0 : s.scale.swings >= 28 && s.scale.swings <= 29);
        assert_false(s.scale.poles);
        if (!(i % 2)) assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
        sdm_shape_survey_dispose(&s);
    }
}

// An angle in rad that mesh() multiplies by 180 / pi, and angles with other factors, such as
// numbers of teeth: a vertex comes back after another change of the angle.
static void rad_that_become_degrees(void **state)
{
    (void)state;
    static const struct {
        const char *factor, *unit;
        double max;
        size_t swings;
    } cases[] = {{"57.29577951308232", "rad", 0.9, 4},
                 {"57.3", "rad", 0.9, 4},
                 {"57.3", "rad", 5, 42},
                 {"57.3", "rad", 0.65, 0},
                 {"57.3", "", 0.9, 0},
                 {"1", "rad", 6.8, 0},
                 {"20", "rad", 0.9, 0},
                 {"57", "rad", 0.9, 0},
                 {"58", "rad", 0.9, 0},
                 {"115", "rad", 0.9, 0},
                 {"172", "rad", 0.9, 0},
                 {"401", "rad", 0.9, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_shape_survey s =
            survey_swinging((sdm_param){"angle", cases[i].unit, 0.5, cases[i].max, 0.6, "x"}, "sin",
                            cases[i].factor);
        if (s.scale.spins != (cases[i].swings > 0) || s.scale.swings != cases[i].swings)
            fail_msg("%s times up to %g %s: %zu", cases[i].factor, cases[i].max, cases[i].unit,
                     s.scale.swings);
        if (s.scale.spins) assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
        sdm_shape_survey_dispose(&s);
    }
    // a single vertex of eight comes back
    sdm_shape_survey s =
        survey_swinging((sdm_param){"twist", "rad", 0.5, 0.9, 0.6, "x"}, "twist", "57.3");
    assert_false(s.scale.spins);
    sdm_shape_survey_dispose(&s);
}

// The same for functions with poles: tan(), also of half of the angle, and a division by cos(). A
// range in mm, and functions without poles, are none.
static void degrees_that_go_to_tan(void **state)
{
    (void)state;
    static const struct {
        const char *function, *factor;
        double max;
        size_t poles;
    } cases[] = {{"tan", "1", 20, 6},    {"tan", "1", 5, 2},         {"half", "1", 30, 5},
                 {"secant", "1", 20, 6}, {"tan", "0.017453", 20, 0}, {"tan", "1", 1.5, 0},
                 {"steep", "1", 60, 0},  {"saw", "1", 20, 0}};
    const double pi = acos(-1);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (size_t unit = 0; unit < 3; unit++) {
            sdm_shape_survey s =
                survey_swinging((sdm_param){"angle", ANGLE_UNITS[unit], 0, cases[i].max, 1, "x"},
                                cases[i].function, cases[i].factor);
            const double turn = i == 2 ? 2 : 1;
            if (s.scale.poles != (cases[i].poles > 0))
                fail_msg("%s up to %g", cases[i].function, cases[i].max);
            if (s.scale.poles) {
                assert_int_equal(s.scale.swings, cases[i].poles);
                assert_true(fabs(s.scale.pole[0] - turn * pi / 2) < 1e-5);
                assert_true(fabs(s.scale.pole[1] - turn * 3 * pi / 2) < 1e-5);
                assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
            }
            sdm_shape_survey_dispose(&s);
        }
    sdm_shape_survey s = survey_swinging((sdm_param){"length", "mm", 0, 20, 1, "x"}, "tan", "1");
    assert_false(s.scale.poles);
    sdm_shape_survey_dispose(&s);
}

// Degrees that turn a part by 57.3 times as many degrees, or as few. Ranges below 13 degrees show
// no two turns. Half and twice the angle are a matter of where it is measured; other factors, other
// units and a part that changes its form are no mistakes.
static void degrees_that_turn_a_part(void **state)
{
    (void)state;
    static const struct {
        const char *function, *factor, *unit;
        double max, degrees;
    } cases[] = {{"rigid", "1", "deg", 12, 57.29578},
                 {"rigid", "1", "degrees", 0.5, 57.29578},
                 {"rigid", "0.5", "deg", 4, 28.64789},
                 {"rigid", "2", "deg", 4, 114.59156},
                 {"rigid", "0.00030461741978670857", "deg", 90, 0.01745329},
                 {"rigid", "0.00030461741978670857", "deg", 8, 0.01745329},
                 {"rigid", "0.017453292519943295", "deg", 12, 0},
                 {"rigid", "0.017453292519943295", "deg", 180, 0},
                 {"rigid", "0.034906585039886590", "deg", 12, 0},
                 {"rigid", "0.9", "deg", 6, 0},
                 {"rigid", "0.001", "deg", 12, 0},
                 {"rigid", "1", "rad", 5, 0},
                 {"rigid", "1", "", 5, 0},
                 {"cone", "1", "deg", 1, 0},
                 {"cone", "0.00030461741978670857", "deg", 12, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        sdm_shape_survey s = survey_swinging(
            (sdm_param){"tilt", cases[i].unit, 0, cases[i].max, 0.1 * cases[i].max, "x"},
            cases[i].function, cases[i].factor);
        if (!(fabs(s.scale.turns - cases[i].degrees) <= 1e-5 * cases[i].degrees))
            fail_msg("%s, %s times up to %g %s: %g degrees", cases[i].function, cases[i].factor,
                     cases[i].max, cases[i].unit, s.scale.turns);
        assert_int_equal(s.scale.swings > 0, cases[i].degrees > 0);
        if (s.scale.turns > 0) assert_int_equal(sdm_shape_survey_verdict(&s), SDM_E_QUALITY);
        if (s.scale.turns > 0) assert_true(s.scale.spin_vertex >= 8);
        sdm_shape_survey_dispose(&s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rad_that_are_converted), cmocka_unit_test(degrees_that_go_to_sin),
        cmocka_unit_test(rad_that_become_degrees), cmocka_unit_test(degrees_that_go_to_tan),
        cmocka_unit_test(degrees_that_turn_a_part)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
