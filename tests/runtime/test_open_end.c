/* Fits of shapes that are open at an end, with a wider space beyond it.
 * Tests: open_end.c open_space.c beyond.c cochlea.c duct.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "fit/open/open_space.h"
#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "oracle/fit_tools.h"
#include "sdm/internal/open_end.h"
#include "sdm/internal/vec3.h"

/* ---- the open end of the shapes */

static sdm_instance *instance(const char *name, const sdm_named_text *options, size_t n)
{
    sdm_instance *s = NULL;
    sdm_error err = {0};
    if (sdm_instance_create(sdm_registry_find(registry, name, NULL), options, n, NULL, &s, &err))
        fail_msg("%s", err.text);
    return s;
}

// A point of the parameters' ranges, from its middle to one side.
static void some_params(const sdm_instance *s, uint64_t seed, double *p)
{
    size_t n;
    const sdm_param *of = sdm_instance_params(s, &n);
    for (size_t k = 0; k < n; k++)
        p[k] = of[k].min + (0.3 + 0.4 * sdm_rng_uniform(5, seed, k)) * (of[k].max - of[k].min);
}

// The mesh ends in the plane: a ring of its vertices lies in it, within the radius about the
// centre, and their mean is near the centre; the vertex 0, the pole of the cap, lies beyond.
static void check_end(sdm_instance *s, const double *p)
{
    sdm_open_end e;
    sdm_mesh m = {0};
    sdm_error err = {0};
    double mean[3] = {0}, in_plane = 0, pole = 0, most = 0;
    assert_true(sdm_instance_has_open_end(s));
    if (sdm_instance_open_end(s, p, &e, &err) || sdm_instance_mesh(s, p, &m, &err))
        fail_msg("%s", err.text);
    assert_true(fabs(v3_norm(e.outward) - 1) < 1e-12);
    for (size_t v = 0; v < m.n_vert; v++) {
        double d[3];
        for (int k = 0; k < 3; k++) d[k] = m.vert[3 * v + (size_t)k] - e.centre[k];
        const double ahead = v3_dot(d, e.outward);
        if (!v) pole = ahead;
        if (fabs(ahead) > 1e-9 || v3_norm(d) > 1.01 * e.radius) continue;
        in_plane++;
        most = fmax(most, v3_norm(d));
        for (int k = 0; k < 3; k++) mean[k] += d[k];
    }
    assert_true(in_plane >= 8 && v3_norm(mean) / in_plane < 0.3 * e.radius);
    assert_true(most > 0.5 * e.radius && pole > 0.2 * e.radius && pole <= 1.0001 * e.radius);
    sdm_mesh_dispose(&m);
}

static void test_shapes_end_in_the_plane(void **state)
{
    (void)state;
    const sdm_named_text of_cochlea[] = {{"ear", "left"}, {"section", "ellipse"}},
                         of_duct[] = {{"ear", "left"}, {"detail", "1"}};
    for (size_t i = 0; i < 4; i++) {
        sdm_instance *s = i < 2 ? instance("cochlea", of_cochlea, i ? 2 : 0)
                                : instance("duct", of_duct, i == 2 ? 0 : 2);
        double p[64];
        for (uint64_t seed = 0; seed < 4; seed++) {
            some_params(s, seed, p);
            check_end(s, p);
        }
        sdm_instance_free(s);
    }
    assert_false(sdm_instance_has_open_end(ellipsoid));
}

/* An end that is wrong in one of several ways, by the parameter. */
static int wrong_end(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_open_end *out)
{
    (void)self, (void)options;
    if (p[0] > 3) return (host->fail)(host, "no end at all");
    *out = (sdm_open_end){
        .centre = {0, p[0] > 2 ? NAN : 1, 0}, .outward = {0, 0, p[0] > 1 ? 0 : -2}, .radius = p[0]};
    return 0;
}

static void test_wrong_ends_are_errors(void **state)
{
    (void)state;
    const sdm_param params[] = {{"size", "mm", -1, 5, 1, "size"}};
    const sdm_shape table = {.abi = SDM_SHAPE_ABI,
                             .size = sizeof(sdm_shape),
                             .name = "wrong",
                             .summary = "a wrong end",
                             .params = params,
                             .n_params = 1,
                             .open_end = wrong_end};
    sdm_instance *s = NULL;
    sdm_open_end e;
    sdm_error err = {0};
    assert_int_equal(sdm_instance_create(&table, NULL, 0, NULL, &s, NULL), SDM_OK);
    const struct {
        double size;
        const char *text;
    } rows[] = {{4, "no end at all"},
                {2.5, "a number that is not finite"},
                {1.5, "a normal of length 0"},
                {-0.5, "a radius of -0.5 mm"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        assert_int_equal(sdm_instance_open_end(s, &rows[i].size, &e, &err), SDM_E_PLUGIN);
        if (!strstr(err.text, rows[i].text) || !strstr(err.text, "shape 'wrong' at size="))
            fail_msg("%s", err.text);
    }
    const double right = 0.5;
    assert_int_equal(sdm_instance_open_end(s, &right, &e, NULL), SDM_OK);
    assert_true(e.outward[2] == -1 && e.radius == 0.5);
    sdm_instance_free(s);
    assert_int_equal(sdm_instance_open_end(ellipsoid, TRUTH, &e, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "shape 'ellipsoid' states no open end"));
}

/* ---- the space beyond */

static void test_weights(void **state)
{
    (void)state;
    fit_open_end e = {
        .centre = {1, -2, 0.5}, .outward = {0.6, 0, -0.8}, .radius = 1.2, .margin = 1.5};
    // along the normal: nothing before the plane, all from a quarter of the radius to the margin
    for (double ahead = -4; ahead < 4; ahead += 0.05) {
        double y[3];
        for (int k = 0; k < 3; k++) y[k] = e.centre[k] + ahead * e.outward[k];
        const double w = sdm_fit_open_end_weight(&e, y, NULL, NULL);
        if (ahead <= 0 || ahead >= 3) assert_true(w == 0);
        if (ahead >= 0.31 && ahead <= 2.7) assert_true(w == 1);
        assert_true(w >= 0 && w <= 1);
    }
    // derivatives
    double *number[FIT_OPEN_NUMBERS] = {e.centre,      e.centre + 1,  e.centre + 2, e.outward,
                                        e.outward + 1, e.outward + 2, &e.radius};
    size_t soft = 0;
    for (uint64_t i = 0; i < 3000; i++) {
        double y[3], by_y[3], by_numbers[FIT_OPEN_NUMBERS];
        const double h = 1e-5;
        for (size_t k = 0; k < 3; k++) y[k] = e.centre[k] + 6 * sdm_rng_uniform(6, i, k) - 3;
        const double w = sdm_fit_open_end_weight(&e, y, by_y, by_numbers);
        soft += w > 0 && w < 1;
        for (size_t k = 0; k < 3 + FIT_OPEN_NUMBERS; k++) {
            double *x = k < 3 ? y + k : number[k - 3], at = *x, side[2];
            *x = at + h, side[1] = sdm_fit_open_end_weight(&e, y, NULL, NULL);
            *x = at - h, side[0] = sdm_fit_open_end_weight(&e, y, NULL, NULL);
            *x = at;
            assert_true(
                fabs((side[1] - side[0]) / (2 * h) - (k < 3 ? by_y[k] : by_numbers[k - 3])) < 2e-3);
        }
    }
    assert_true(soft > 100);
}

/* ---- images */

/* An ear: parameters (a, alpha, b, phi) and pose of a cochlea. */
typedef struct ear {
    double p[4];
    sdm_pose pose;
} ear;

static const ear EARS[] = {{{4.4, 0.5, 0.145, 0.2}, {{0.3, -0.2, 0.4}, {0.4, -0.3, 0.2}}},
                           {{3.9, 0.8, 0.12, -0.3}, {{-0.5, 0.4, 1.1}, {-0.2, 0.1, 0.3}}}};

typedef enum space { CLOSED, BALL, BOX } space;

static sdm_grid ear_grid(void)
{
    return sdm_grid_centred((int64_t[3]){52, 52, 44}, 0.35, (double[3]){0.5, 0, 0.8});
}

static sdm_fit_source ear_source(const sdm_instance *cochlea)
{
    return (sdm_fit_source){
        .shape = cochlea,
        .grid = sdm_grid_centred((int64_t[3]){46, 42, 32}, 0.3, (double[3]){0.9, 0.3, 1.5})};
}

/* Signed distance (mm, about) at a point of the cochlea's frame to a space that the basal end opens
 * into. The end at theta = 0 by the formulas of cochlea.c. */
static double space_distance(const double p[4], space kind, const double y[3])
{
    const double c = 0.2, kappa = 0.3, centre[3] = {p[0], 0, p[1] * cos(p[3])},
                 along[3] = {-p[0] * p[2], p[0], c - kappa * p[1] * cos(p[3]) + p[1] * sin(p[3])},
                 length = v3_norm(along), horizontal = hypot(along[0], along[1]);
    const double out[3] = {-along[0] / length, -along[1] / length, -along[2] / length},
                 side[3] = {along[1] / horizontal, -along[0] / horizontal, 0};
    double up[3], d[3];
    v3_cross(out, side, up);
    for (int k = 0; k < 3; k++) d[k] = y[k] - centre[k];
    const double x[3] = {v3_dot(d, out), v3_dot(d, side), v3_dot(d, up)};
    if (kind == BALL) { // cut off at the plane of the end
        const double from[3] = {x[0] - 1.9, x[1], x[2] - 0.5};
        return fmax(v3_norm(from) - 2.4, -x[0]);
    }
    return fmax(fmax(fabs(x[0] - 1.6) - 1.6, fabs(x[1] - 0.6) - 2), fabs(x[2]) - 2.6);
}

// The image of an ear (caller frees).
static float *ear_image(const sdm_instance *cochlea, const ear *e, space kind)
{
    const sdm_grid g = ear_grid();
    const size_t n = sdm_grid_count(&g);
    sdm_phantom_opts o = sdm_phantom_defaults();
    sdm_error err = {0};
    float *v = calloc(n, sizeof *v);
    if (!v) abort();
    for (int k = 0; k < 3; k++) o.blur[k] = 0.25;
    o.seed = 17;
    if (sdm_phantom_make(cochlea, e->p, &e->pose, &o, &g, v, NULL, &err)) fail_msg("%s", err.text);
    double r[9];
    sdm_pose_matrix(&e->pose, r);
    const fit_state s = {
        .rotation = {r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]},
        .translation = {e->pose.translation[0], e->pose.translation[1], e->pose.translation[2]}};
    for (size_t i = 0; i < n && kind != CLOSED; i++) {
        const size_t nx = (size_t)g.n[0], ny = (size_t)g.n[1];
        const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
        double x[3], y[3];
        sdm_grid_world(&g, index, x);
        sdm_fit_to_shape(&s, x, y);
        const double share = 0.5 * erfc(space_distance(e->p, kind, y) / (0.25 * sqrt(2)));
        v[i] += (float)(share * (40 + 150 * sdm_rng_normal(9, 0, i) - (double)v[i]));
    }
    return v;
}

/* Fits an ear from a start beside it. */
static sdm_fit_result ear_fit(const sdm_instance *cochlea, const ear *e, space kind, bool open_end)
{
    static const double start[4] = {4.2, 0.6, 0.14, 0};
    float *v = ear_image(cochlea, e, kind);
    const sdm_fit_target t = {.kind = SDM_FIT_IMAGE, .grid = ear_grid(), .values = v};
    const sdm_fit_source source = ear_source(cochlea);
    const sdm_pose off = {{0.1, 0.08, -0.1}, {0.2, 0.2, -0.2}};
    sdm_fit_opts o = sdm_fit_defaults();
    o.start_params = start;
    o.start_pose = sdm_pose_compose(&off, &e->pose);
    o.appearance.n_outside = 1;
    o.eps = o.polish_eps = 1e-3;
    o.max_iterations = 40;
    o.max_restarts = 0;
    o.open_end = open_end;
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
    if (s && s != SDM_E_QUALITY) fail_msg("%s", err.text);
    free(v);
    return r;
}

/* Root mean square of the motion of the vertices from the truth to the fit, mm. */
static double moved(const sdm_instance *cochlea, const ear *e, const sdm_fit_result *r)
{
    sdm_mesh a = {0}, b = {0};
    double sum = 0;
    if (sdm_instance_mesh(cochlea, e->p, &a, NULL) ||
        sdm_instance_mesh(cochlea, r->params, &b, NULL))
        abort();
    for (size_t v = 0; v < a.n_vert; v++) {
        double x[3], y[3];
        sdm_pose_apply(&e->pose, a.vert + 3 * v, x);
        sdm_pose_apply(&r->pose, b.vert + 3 * v, y);
        sum += v3_dist2(x, y) / (double)a.n_vert;
    }
    sdm_mesh_dispose(&a);
    sdm_mesh_dispose(&b);
    return sqrt(sum);
}

// With the open end a cochlea that opens into a ball or a box is found; without it the cochlea
// stretches into the space. Where it ends in bone, the open end loses what the bone shows of it.
static void test_a_space_beyond_attracts_no_cochlea(void **state)
{
    (void)state;
    sdm_instance *cochlea = instance("cochlea", NULL, 0);
    const struct {
        space kind;
        bool open_end;
        double least, most; // motion of the vertices, mm
    } rows[] = {{CLOSED, false, 0, 0.2}, {CLOSED, true, 0, 0.5}, {BALL, true, 0, 0.3},
                {BALL, false, 1, 3},     {BOX, true, 0, 0.3},    {BOX, false, 1, 3}};
    for (size_t i = 0; i < 2; i++)
        for (size_t k = 0; k < sizeof rows / sizeof *rows; k++) {
            sdm_fit_result r = ear_fit(cochlea, &EARS[i], rows[k].kind, rows[k].open_end);
            const double far = moved(cochlea, &EARS[i], &r);
            if (!(far >= rows[k].least && far <= rows[k].most))
                fail_msg("ear %zu, row %zu: moved by %g mm", i, k, far);
            assert_true(rows[k].open_end ? r.n_beyond > 500 && r.n_beyond < r.n_used / 4
                                         : r.n_beyond == 0);
            for (size_t p = 0; p < 4 && rows[k].open_end; p++)
                if (!(fabs(r.params[p] - EARS[i].p[p]) < 4 * r.sd[p]))
                    fail_msg("ear %zu, row %zu: parameter %zu is %g +- %g", i, k, p, r.params[p],
                             r.sd[p]);
            sdm_fit_dispose(&r);
        }
    sdm_instance_free(cochlea);
}

// The derivatives of the objective match differences, those of the weights beyond included: beside
// the end of the image there is a ball, which the shape does not explain.
static void test_gradient_matches_differences(void **state)
{
    (void)state;
    sdm_instance *cochlea = instance("cochlea", NULL, 0);
    const ear *e = &EARS[0];
    float *v = ear_image(cochlea, e, BALL);
    const sdm_fit_target t = {.kind = SDM_FIT_IMAGE, .grid = ear_grid(), .values = v};
    const sdm_fit_source source = ear_source(cochlea);
    sdm_fit_opts o = sdm_fit_defaults();
    o.appearance.n_outside = 1;
    fit_problem p = {.source = &source,
                     .target = &t,
                     .opts = &o,
                     .n_params = 4,
                     .stride = 1,
                     .noise_factor = 1,
                     .extent = {.reach = 5}};
    size_t n_params;
    const sdm_param *of = sdm_instance_params(cochlea, &n_params);
    for (size_t k = 0; k < 4; k++) p.low[k] = of[k].min, p.high[k] = of[k].max;
    assert_int_equal(sdm_fit_maps_create(&source, true, &o, &p.maps, NULL), SDM_OK);
    fit_state s = {.blur = 0.3, .l_ref = 0.2, .point_sd = 0.1, .appearance = o.appearance};
    sdm_pose_matrix(&e->pose, s.rotation);
    memcpy(s.translation, e->pose.translation, sizeof s.translation);
    memcpy(s.params, e->p, sizeof e->p);
    p.maps_params[0] = p.maps_blur = NAN;
    const size_t n = fit_columns(4) + 2;
    double gradient[2][FIT_UNKNOWNS_MAX], difference[2][FIT_UNKNOWNS_MAX], size[FIT_UNKNOWNS_MAX];
    assert_int_equal(sdm_fit_information_create(n, &p.information, NULL), SDM_OK);
    for (int open = 0; open < 2; open++) {
        o.open_end = open;
        const fit_region region = {.centre = {0.5, 0, 0.8}, .radius = 9};
        bool changed;
        assert_int_equal(sdm_fit_samples_choose(&t, &o, &region, 1, &p.samples, &changed, NULL),
                         SDM_OK);
        p.state = s;
        assert_int_equal(sdm_fit_evaluate(&p, NULL), SDM_OK);
        memcpy(gradient[open], p.information.gradient, n * sizeof **gradient);
        for (size_t k = 0; k < n; k++) {
            const double h = k >= fit_columns(4) ? 1 : 2e-4;
            double step[FIT_UNKNOWNS_MAX] = {0}, found[2];
            size[k] = sqrt(p.information.complete[k * (n + 1)]);
            for (int side = 0; side < 2; side++) {
                step[k] = side ? h : -h;
                sdm_fit_state_move(&p, &s, step, &p.state);
                assert_int_equal(sdm_fit_evaluate(&p, NULL), SDM_OK);
                found[side] = p.information.log_likelihood;
            }
            p.state = s;
            assert_int_equal(sdm_fit_evaluate(&p, NULL), SDM_OK);
            difference[open][k] = (found[1] - found[0]) / (2 * h);
        }
    }
    // the kinks of the maps are the same in both, so the change by the open end is free of them
    for (size_t k = 0; k < n; k++) {
        const double change = gradient[1][k] - gradient[0][k],
                     wanted = difference[1][k] - difference[0][k];
        if (k == fit_at_blur(4)) continue;
        if (!(fabs(change - wanted) <= 4e-3 * fabs(wanted) + 1e-4 * size[k] &&
              fabs(wanted) > 0.1 * size[k]))
            fail_msg("unknown %zu: %g, differences %g (one sd: %g)", k, change, wanted, size[k]);
    }
    sdm_fit_maps_dispose(&p.maps);
    sdm_fit_samples_dispose(&p.samples);
    sdm_fit_information_dispose(&p.information);
    free(v);
    sdm_instance_free(cochlea);
}

static void test_refused(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0.3, 7);
    const sdm_fit_target image = image_of(v);
    const double points[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const sdm_fit_target cloud = {.kind = SDM_FIT_POINTS, .points = points, .n_points = 3};
    sdm_fit_source source = exact_source();
    sdm_fit_opts o = near_start();
    sdm_fit_result r;
    sdm_error err = {0};
    o.open_end = true;
    assert_int_equal(sdm_fit(&source, &image, &o, &r, &err), SDM_E_ARG);
    if (!strstr(err.text, "the shape states no open end")) fail_msg("%s", err.text);
    o.start_params = NULL;
    sdm_instance *cochlea = instance("cochlea", NULL, 0);
    source = ear_source(cochlea);
    assert_int_equal(sdm_fit(&source, &cloud, &o, &r, &err), SDM_E_ARG);
    if (!strstr(err.text, "points do not show")) fail_msg("%s", err.text);
    sdm_instance_free(cochlea);
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_shapes_end_in_the_plane),
                                       cmocka_unit_test(test_wrong_ends_are_errors),
                                       cmocka_unit_test(test_weights),
                                       cmocka_unit_test(test_gradient_matches_differences),
                                       cmocka_unit_test(test_refused),
                                       cmocka_unit_test(test_a_space_beyond_attracts_no_cochlea)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
