/* Outlying points of a fit: those that lie together are told with their number and place, those at
 * any places are not.
 * Tests: outlying.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "fit/judge/outlying.h"
#include "oracle/fit_tools.h"
#include "sdm/internal/vec3.h"

enum { MOST = 50000 };
#define PI 3.14159265358979324
#define SD 0.03

/* Points on a ball of radius 3 with normal errors. */
typedef struct ball {
    fit_distances points;
    uint64_t seed;
} ball;

#define RADIUS 3.0

static double uniform(const ball *b, size_t what, size_t i)
{
    return sdm_rng_uniform(b->seed, what, i);
}

/* Places point i in this direction from the middle, `off` mm outside of the surface. */
static void place(ball *b, size_t i, const double direction[3], double off)
{
    for (size_t a = 0; a < 3; a++) b->points.x[i][a] = (RADIUS + off) * direction[a];
    b->points.distance[i] = off;
}

static void direction_of(const ball *b, size_t i, double out[3])
{
    const double z = 2 * uniform(b, 0, i) - 1, turn = 2 * PI * uniform(b, 1, i),
                 r = sqrt(1 - z * z);
    out[0] = r * cos(turn), out[1] = r * sin(turn), out[2] = z;
}

static ball ball_of(size_t n, uint64_t seed)
{
    ball b = {.points = {.n = n, .far = 5 * SD}, .seed = seed};
    b.points.x = calloc(n, sizeof *b.points.x);
    b.points.distance = calloc(n, sizeof *b.points.distance);
    if (!b.points.x || !b.points.distance) abort();
    for (size_t i = 0; i < n; i++) {
        double u[3];
        direction_of(&b, i, u);
        place(&b, i, u, SD * sdm_rng_normal(seed, 2, i));
    }
    return b;
}

static void ball_dispose(ball *b)
{
    free(b->points.x);
    free(b->points.distance);
}

/* Moves the m points at the top of the ball inside (-1) or outside (1) by 7 to 25 standard
   deviations. Their area is m / n of the ball's, and so is that of the cap of height 2 RADIUS m /
   n. */
static void displace_top(ball *b, size_t m, double side)
{
    const double height = 2 * (double)m / (double)b->points.n;
    size_t moved = 0;
    for (size_t i = 0; i < b->points.n && moved < m; i++) {
        double u[3];
        direction_of(b, i, u);
        if (u[2] < 1 - 1.5 * height) continue;
        place(b, i, u, side * SD * (7 + 18 * uniform(b, 3, i)));
        moved++;
    }
    assert_int_equal(moved, m);
}

typedef enum strays { BESIDE, BOX } strays;

/* Makes this share of the other points outliers: 5 to 30 standard deviations beside the surface on
 * either side, or anywhere in a box. */
static void scatter(ball *b, double share, strays where)
{
    for (size_t i = 0; i < b->points.n; i++) {
        double u[3], square = 0;
        direction_of(b, i, u);
        if (uniform(b, 4, i) >= share || fabs(b->points.distance[i]) > b->points.far) continue;
        if (where == BESIDE) {
            place(b, i, u, (uniform(b, 5, i) < 0.5 ? -1 : 1) * SD * (5 + 25 * uniform(b, 6, i)));
            continue;
        }
        for (size_t a = 0; a < 3; a++) u[a] = 12 * uniform(b, 7 + a, i) - 6;
        for (size_t a = 0; a < 3; a++) square += u[a] * u[a];
        for (size_t a = 0; a < 3; a++) u[a] /= sqrt(square);
        place(b, i, u, sqrt(square) - RADIUS);
    }
}

static fit_groups groups_of(const ball *b)
{
    fit_groups g;
    assert_int_equal(sdm_fit_groups_find(&b->points, &g, NULL), SDM_OK);
    return g;
}

static void test_points_together_are_found(void **state)
{
    (void)state;
    static const size_t cases[3][2] = {{500, 10}, {4000, 30}, {MOST, 100}};
    static const double shares[3] = {0, 0.01, 0.05};
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 6; k++)
            for (uint64_t seed = 1; seed <= (c < 2 ? 4 : 1); seed++) {
                const double side = k % 2 ? 1 : -1, m = (double)cases[c][1];
                ball b = ball_of(cases[c][0], seed);
                displace_top(&b, cases[c][1], side);
                scatter(&b, shares[k / 2], BOX);
                const fit_groups g = groups_of(&b);
                const double top = RADIUS + g.mean,
                             width = RADIUS * sqrt(12 * m / (double)b.points.n);
                if (!((double)g.largest > 0.75 * m && (double)g.largest < 1.2 * m) ||
                    g.mean * side < 10 * SD || g.mean * side > 22 * SD ||
                    hypot(hypot(g.centre[0], g.centre[1]), g.centre[2] - top) > 0.6 * width ||
                    g.nearest < 5 * SD || g.farthest > 60 * SD)
                    fail_msg("%zu of %zu, share %g, seed %zu: %zu at (%g, %g, %g), %g mm",
                             cases[c][1], cases[c][0], shares[k / 2], (size_t)seed, g.largest,
                             g.centre[0], g.centre[1], g.centre[2], g.mean);
                ball_dispose(&b);
            }
}

static void test_points_anywhere_are_no_group(void **state)
{
    (void)state;
    static const size_t sizes[3] = {100, 500, 4000};
    static const double shares[4] = {0, 0.01, 0.05, 0.2};
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 8; k++)
            for (uint64_t seed = 1; seed <= 10; seed++) {
                ball b = ball_of(sizes[c], 100 + seed);
                scatter(&b, shares[k / 2], k % 2 ? BOX : BESIDE);
                const fit_groups g = groups_of(&b);
                if (g.largest || g.n)
                    fail_msg("%zu points, share %g, seed %zu: %zu at (%g, %g, %g)", sizes[c],
                             shares[k / 2], (size_t)seed, g.largest, g.centre[0], g.centre[1],
                             g.centre[2]);
                ball_dispose(&b);
            }
}

// Where the noise is five times larger, points are outlying on both sides: it is no other shape.
static void test_noise_on_both_sides_is_no_group(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 10; seed++) {
        ball b = ball_of(4000, seed);
        for (size_t i = 0; i < b.points.n; i++) {
            double u[3];
            direction_of(&b, i, u);
            if (u[2] > 0.6) place(&b, i, u, 5 * SD * sdm_rng_normal(seed, 2, i));
        }
        assert_int_equal(groups_of(&b).n, 0);
        ball_dispose(&b);
    }
}

/* Fits the ellipsoid TRUTH to 1500 points with normal errors of 0.04 mm, of which the `together`
 * nearest to the end of its x axis lie 8 to 10 standard deviations inside: too few for the robust
 * model to take them for strays. If there are none, 3 % lie anywhere unless keep_sd. */
static sdm_fit_result fit_with(size_t together, bool keep_sd)
{
    enum { N = 1500 };
    const double sd = 0.04;
    sdm_mesh mesh = {0};
    double x[3 * N];
    assert_int_equal(sdm_instance_mesh(ellipsoid, TRUTH, &mesh, NULL), SDM_OK);
    assert_int_equal(sdm_fit_surface_points(&mesh, N, 3, x, NULL), SDM_OK);
    double from = TRUTH[0];
    for (size_t n = 0; n < together; from -= 0.01)
        for (size_t i = n = 0; i < N; i++) n += x[3 * i] > from - 0.01;
    for (size_t i = 0; i < N; i++) {
        double y[3], u[3], length = 0;
        for (size_t a = 0; a < 3; a++) u[a] = x[3 * i + a] / (TRUTH[a] * TRUTH[a]);
        for (size_t a = 0; a < 3; a++) length += u[a] * u[a];
        const double off = x[3 * i] > from ? -sd * (8 + 2 * sdm_rng_uniform(4, 0, i)) : 0;
        const bool stray = !keep_sd && !together && i % 33 == 0;
        for (size_t a = 0; a < 3; a++)
            y[a] = stray ? 6 * sdm_rng_uniform(5, a, i) - 3
                         : x[3 * i + a] + off * u[a] / sqrt(length) + sd * sdm_rng_normal(6, a, i);
        sdm_pose_apply(&POSE, y, x + 3 * i);
    }
    const sdm_fit_source source = exact_source();
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = x, .n_points = N};
    sdm_fit_opts o = near_start();
    o.keep_appearance = keep_sd;
    o.point_sd = sd;
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, &t, &o, &r, &err)) fail_msg("%s", err.text);
    sdm_mesh_dispose(&mesh);
    return r;
}

static const sdm_fit_finding *patch_of(const sdm_fit_result *r)
{
    for (size_t i = 0; i < r->verdict.n_findings; i++)
        if (r->verdict.findings[i].kind == SDM_FIT_CHECK_PATCH) return &r->verdict.findings[i];
    fail_msg("no check `patch`");
    return NULL;
}

static void test_a_fit_names_points_together(void **state)
{
    (void)state;
    for (int keep_sd = 0; keep_sd < 2; keep_sd++) {
        sdm_fit_result r = fit_with(16, keep_sd);
        const sdm_fit_finding *f = patch_of(&r);
        double many = 0, least = 0, most = 0, sds = 0, at[3] = {0}, top[3];
        sdm_pose_apply(&POSE, (const double[3]){TRUTH[0] - 0.38, 0, 0}, top);
        if (f->grade != SDM_FIT_DOUBTFUL ||
            sscanf(f->text,
                   "about %lf points lie together %lf to %lf mm inside the fitted surface, on "
                   "average %lf standard deviations of the points, at (%lf, %lf, %lf) mm",
                   &many, &least, &most, &sds, &at[0], &at[1], &at[2]) != 7 ||
            !strstr(f->text, "the data lack a part of the shape, or show a hollow"))
            fail_msg("%d: %g: %s", keep_sd, f->figure, f->text);
        if (fabs(many - 16) > 3 || least < 0.2 || most > 0.7 || sds < 6 || sds > 12 ||
            sqrt(v3_dist2(at, top)) > 0.3)
            fail_msg("%d: %s", keep_sd, f->text);
        assert_true(f->figure > f->limit && f->limit < 0.006);
        sdm_fit_dispose(&r);
        r = fit_with(0, keep_sd);
        if (patch_of(&r)->grade != SDM_FIT_PASSED) fail_msg("%s", patch_of(&r)->text);
        sdm_fit_dispose(&r);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_together_are_found),
        cmocka_unit_test(test_points_anywhere_are_no_group),
        cmocka_unit_test(test_noise_on_both_sides_is_no_group),
        cmocka_unit_test(test_a_fit_names_points_together),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
