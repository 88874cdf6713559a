/* A fit whose averaged steps go to and fro across the edges of a coarse mesh: they come to rest.
 * The text on a fit that still goes to and fro. Tests: convergence.c newton.c recent.c solve.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "fit/judge/finding.h"
#include "fit/solver/recent.h"
#include "fit/solver/solve.h"
#include "fit/trust/convergence.h"
#include "oracle/fit_tools.h"

enum { RADIUS, HEIGHT, SPOUT, TILT, POT_PARAMS };
static const sdm_param pot_params[POT_PARAMS] = {
    {"radius", "mm", 60, 80, 70, "of the body"},
    {"height", "mm", 90, 120, 105, "of the body"},
    {"spout", "mm", 75, 105, 90, "length of the spout"},
    {"tilt", "rad", 0.5, 0.9, 0.7, "of the spout"}};

/* An ellipsoid, and a spout from inside it outwards: rings of AROUND vertices between two poles. */
enum { AROUND = 40, BODY = 24, TUBE = 12, N_VERT = (BODY + TUBE) * AROUND + 4 };

static double *put(double *v, double x, double y, double z)
{
    v[0] = x, v[1] = y, v[2] = z;
    return v + 3;
}

static uint32_t *face(uint32_t *t, uint32_t a, uint32_t b, uint32_t c)
{
    t[0] = a, t[1] = b, t[2] = c;
    return t + 3;
}

static uint32_t *faces(uint32_t *t, uint32_t first, uint32_t rings)
{
    const uint32_t r0 = first + 1, last = r0 + (rings - 1) * AROUND, end = last + AROUND;
    for (uint32_t j = 0; j < AROUND; j++) {
        const uint32_t k = (j + 1) % AROUND;
        t = face(t, first, r0 + k, r0 + j);
        for (uint32_t r = r0; r < last; r += AROUND) {
            t = face(t, r + j, r + k, r + AROUND + k);
            t = face(t, r + j, r + AROUND + k, r + AROUND + j);
        }
        t = face(t, last + j, last + k, end);
    }
    return t;
}

static const double TURN = 6.283185307179586 / AROUND;

static int pot_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                    const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    const int failed = host->reserve(host, out, N_VERT, 2 * (BODY + TUBE) * AROUND);
    if (failed) return failed;
    double *v = put(out->vert, 0, 0, -0.5 * p[HEIGHT]);
    for (int i = 1; i <= BODY; i++)
        for (int j = 0; j < AROUND; j++) {
            const double s = 3.141592653589793 * i / (BODY + 1), r = p[RADIUS] * sin(s);
            v = put(v, r * cos(TURN * j), r * sin(TURN * j), -0.5 * p[HEIGHT] * cos(s));
        }
    v = put(v, 0, 0, 0.5 * p[HEIGHT]);
    const double dx = cos(p[TILT]), dz = sin(p[TILT]), x = 0.55 * p[RADIUS], z = -0.1 * p[HEIGHT];
    v = put(v, x, 0, z);
    for (int i = 0; i < TUBE; i++)
        for (int j = 0; j < AROUND; j++) {
            const double f = (double)i / (TUBE - 1), s = f * p[SPOUT], r = 15 - 7 * f,
                         c = r * cos(TURN * j);
            v = put(v, x + s * dx + c * dz, r * sin(TURN * j), z + s * dz - c * dx);
        }
    put(v, x + p[SPOUT] * dx, 0, z + p[SPOUT] * dz);
    (void)faces(faces(out->tri, 0, BODY), BODY * AROUND + 2, TUBE);
    return 0;
}

static const sdm_shape pot = {.abi = SDM_SHAPE_ABI,
                              .size = sizeof(sdm_shape),
                              .name = "pot",
                              .summary = "an ellipsoid with a spout",
                              .params = pot_params,
                              .n_params = POT_PARAMS,
                              .mesh = pot_mesh};

/* Points of the lower half of a pot with the parameters of TRUTH_OF_POT, turned by (0.048, -0.131,
 * 0.184) and moved by (-4.1, 1.1, 0.6) mm; normal errors of 0.5 mm; in tenths of a mm. */
enum { POINTS = 50 };
static const int points[POINTS][3] = {
    {-93, 201, -534},   {-626, -80, -346},  {400, -538, 136},   {-277, 78, -530},
    {-594, -436, -17},  {-311, -239, -497}, {-606, -100, -368}, {-732, 72, -197},
    {-511, 251, -402},  {-560, -425, 150},  {322, -515, -246},  {421, 344, -312},
    {-195, -614, -277}, {-185, -16, -557},  {662, 39, -93},     {386, -219, -406},
    {140, 225, -505},   {-134, -697, 61},   {296, 217, -453},   {-90, 115, -555},
    {204, -315, -444},  {-236, -674, -143}, {-535, 262, -370},  {-750, -117, 28},
    {404, 36, -409},    {-647, 397, -3},    {-363, 645, -50},   {-122, -696, -71},
    {103, -501, -373},  {-401, 477, -320},  {196, -20, -514},   {0, 650, -237},
    {549, 299, -198},   {411, 476, -183},   {359, 579, -110},   {-695, -43, -260},
    {365, 568, -104},   {-352, -269, -474}, {-388, -592, -135}, {-625, 429, -83},
    {276, 613, -140},   {-738, 178, 59},    {-309, 6, -535},    {408, -549, 12},
    {-37, 712, -109},   {651, -205, 31},    {5, -601, -298},    {66, -697, 35},
    {-339, 67, -522},   {-464, -516, -220},
};
static const double TRUTH_OF_POT[POT_PARAMS] = {72.3, 113.3, 97.2, 0.588};

static void test_steps_come_to_rest(void **state)
{
    (void)state;
    sdm_instance *shape = NULL;
    double x[3 * POINTS];
    for (size_t i = 0; i < 3 * POINTS; i++) x[i] = 0.1 * points[i / 3][i % 3];
    assert_int_equal(sdm_instance_create(&pot, NULL, 0, NULL, &shape, NULL), SDM_OK);
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){56, 42, 38}, 4.2, (double[3]){15, 0, 5})};
    const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = POINTS};
    sdm_fit_opts o = sdm_fit_defaults();
    o.start_params = (const double[POT_PARAMS]){70, 110, 90, 0.62};
    o.turns = SDM_FIT_TURNS_NONE;
    o.n_threads = 2;
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, &target, &o, &r, &err);
    if (s) fail_msg("%s", err.text);
    if (!(r.converged && strstr(r.reason, "the last steps move every unknown by at most")))
        fail_msg("%zu iterations: %s", r.n_iterations, r.reason);
    for (size_t k = 0; k < POT_PARAMS; k++)
        if (!(fabs(r.params[k] - TRUTH_OF_POT[k]) < 3 * r.sd[k]))
            fail_msg("%s = %g +- %g", pot_params[k].name, r.params[k], r.sd[k]);
    sdm_fit_dispose(&r);
    sdm_instance_free(shape);
}

enum { TURN_Z = POT_PARAMS + 2, UNKNOWNS = POT_PARAMS + 6 };

/* The last iterations of a fit, with the rotation about z at place[i % 2] after iteration i, by
 * the undamped step[i % 2]. */
static void remember_turns(fit_problem *p, const double place[2], const double step[2])
{
    double before = 0;
    p->recent = (fit_recent){0};
    for (int i = 0; i < 2 * FIT_RECENT; i++) {
        double moved[UNKNOWNS] = {0}, plain[UNKNOWNS] = {0};
        moved[TURN_Z] = place[i % 2] - before;
        plain[TURN_Z] = step[i % 2];
        before = place[i % 2];
        sdm_fit_remember(p, moved, plain);
    }
}

/* The text on a fit with these last iterations, after 60 of them; length and tilt of the spout have
 * standard deviations of `open` times that of the prior. */
static const char *text_of(fit_problem *p, double open)
{
    static sdm_fit_result r;
    double sd[UNKNOWNS], prior_sd[POT_PARAMS];
    for (size_t i = 0; i < UNKNOWNS; i++) sd[i] = i == SPOUT || i == TILT ? open : 0.01;
    for (size_t k = 0; k < POT_PARAMS; k++) prior_sd[k] = 1;
    r = (sdm_fit_result){.sd = sd, .prior_sd = prior_sd, .n_iterations = 60};
    sdm_fit_verdict_add(
        &r.verdict,
        &(sdm_fit_finding){.kind = SDM_FIT_CHECK_CONVERGED, .grade = SDM_FIT_FAILED, .text = "-"});
    sdm_fit_name_restless(p, &r, NULL);
    return r.verdict.findings[0].text;
}

static void assert_text(const char *text, const char *wanted, const char *unwanted)
{
    if (!strstr(text, wanted)) fail_msg("'%s' lacks '%s'", text, wanted);
    if (unwanted && strstr(text, unwanted)) fail_msg("'%s' contains '%s'", text, unwanted);
}

static void test_text_names_what_is_open(void **state)
{
    (void)state;
    static fit_problem p;
    const sdm_fit_opts o = sdm_fit_defaults();
    sdm_fit_source source = {0};
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&pot, NULL, 0, NULL, &shape, NULL), SDM_OK);
    source.shape = shape;
    p.opts = &o, p.source = &source, p.n_params = POT_PARAMS;
    // to and fro by 0.2 standard deviations
    remember_turns(&p, (const double[2]){0.002, -0.002}, (const double[2]){0.004, -0.004});
    assert_true(fabs(sdm_fit_swing(&p, TURN_Z) - 0.002) < 1e-12);
    assert_true(sdm_fit_swing(&p, RADIUS) == 0);
    assert_text(text_of(&p, 0.5),
                "; rotation about z still goes to and fro by 0.2 of its standard deviation, need "
                "0.1): the data hardly determine spout, tilt: keep them at known values",
                "max_iterations");
    assert_text(text_of(&p, 0.01), "need 0.1): a nearer start, or data that determine what",
                "max_iterations");
    // in one direction: more iterations may help, and so may known values
    remember_turns(&p, (const double[2]){0.002, -0.002}, (const double[2]){0.004, 0.004});
    assert_true(sdm_fit_swing(&p, TURN_Z) == 0);
    assert_text(
        text_of(&p, 0.5),
        "; rotation about z still moves by 0.4 of its standard deviation, need 0.1): more of "
        "them (sdm_fit_opts.max_iterations), a nearer start, or known values "
        "(sdm_fit_opts.kept) of spout, tilt, which the data hardly determine",
        "to and fro");
    sdm_instance_free(shape);
}

// The inverse of {{4, 0, 1}, {0, 9, 0}, {1, 0, 1}} has the diagonal 1/3, 1/9, 4/3; without the last
// unknown it is 1/4, 1/9.
static void test_inverse(void **state)
{
    (void)state;
    const double a[9] = {4, 0, 1, 0, 9, 0, 1, 0, 1};
    const bool held[2][3] = {{false, false, false}, {false, false, true}};
    const double variance[2][3] = {{1.0 / 3, 1.0 / 9, 4.0 / 3}, {1.0 / 4, 1.0 / 9, 0}};
    double inverse[9], work[18];
    for (int i = 0; i < 2; i++) {
        assert_true(sdm_fit_inverse(3, a, held[i], inverse, work));
        for (int k = 0; k < 3; k++) assert_true(fabs(inverse[4 * k] - variance[i][k]) < 1e-12);
    }
    assert_false(sdm_fit_inverse(2, (const double[4]){1, 2, 2, 1}, held[0], inverse, work));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_steps_come_to_rest),
                                       cmocka_unit_test(test_text_names_what_is_open),
                                       cmocka_unit_test(test_inverse)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
