/* The search of a whole volume for a shape: two tori among balls, rods and noise are found first,
 * with their poses; a volume without tori gives low scores; the same bits for any number of
 * threads. Tests: fit_find.c likeness.c pattern.c turned_pattern.c coarse_scan.c turn_set.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/builtin_shapes.h"
#include "sdm/fit.h"
#include "sdm/internal/rng.h"

enum { N = 128, OTHERS = 40, MOST = 8 };
#define EDGE 0.4
#define INSIDE 40.0
#define OUTSIDE 1300.0

static sdm_registry *registry;
static sdm_instance *torus;
static const double BIG = 3, SMALL = 1;
// middles and axes of the tori
static const double MIDDLE[2][3] = {{14.2, 30.1, 22.7}, {36.4, 17.3, 33.9}};
static const double AXIS[2][3] = {{0.6, 0, 0.8}, {0, 1, 0}};

static int set_up(void **state)
{
    (void)state;
    return sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL) ||
           sdm_instance_create(sdm_registry_find(registry, "torus", NULL),
                               &(sdm_named_text){"edge", "0.5"}, 1, NULL, &torus, NULL);
}

static int tear_down(void **state)
{
    (void)state;
    sdm_instance_free(torus);
    sdm_registry_free(registry);
    return 0;
}

static sdm_fit_source source(void)
{
    return (sdm_fit_source){
        .shape = torus,
        .grid = sdm_grid_centred((int64_t[3]){36, 36, 18}, 0.3, (double[3]){0, 0, 0})};
}

// grid of the volume; first voxel at the origin of its axes, which are turned about z
static sdm_grid volume_grid(void)
{
    sdm_grid g = sdm_grid_centred((int64_t[3]){N, N, N}, EDGE, (double[3]){0, 0, 0});
    const double dir[9] = {0.8, -0.6, 0, 0.6, 0.8, 0, 0, 0, 1};
    memcpy(g.dir, dir, sizeof dir);
    return g;
}

static double torus_distance(const double x[3], const double middle[3], const double axis[3])
{
    double d[3], along = 0, square = 0;
    for (int a = 0; a < 3; a++) d[a] = x[a] - middle[a], along += d[a] * axis[a];
    for (int a = 0; a < 3; a++) square += d[a] * d[a];
    return hypot(sqrt(fmax(square - along * along, 0)) - BIG, along) - SMALL;
}

// distance to the nearest ball or rod along z
static double others_distance(const double x[3])
{
    static double middle[OTHERS][3], radius[OTHERS];
    double least = INFINITY;
    for (uint64_t i = 0; i < OTHERS && !radius[OTHERS - 1]; i++) {
        for (uint64_t a = 0; a < 3; a++) middle[i][a] = N * EDGE * sdm_rng_uniform(8, i, a);
        radius[i] = 0.5 + 1.5 * sdm_rng_uniform(8, i, 3);
    }
    for (int i = 0; i < OTHERS; i++) {
        double square = 0;
        for (int a = 0; a < (i % 2 ? 3 : 2); a++) square += pow(x[a] - middle[i][a], 2);
        least = fmin(least, sqrt(square) - radius[i]);
    }
    return least;
}

// a volume of fluid in bone with tori or without (caller frees)
static float *volume(bool tori)
{
    float *v = malloc(sizeof *v * N * N * N), *to = v;
    if (!v) abort();
    for (int k = 0; k < N; k++)
        for (int j = 0; j < N; j++)
            for (int i = 0; i < N; i++) {
                const double x[3] = {i * EDGE, j * EDGE, k * EDGE};
                double first = torus_distance(x, MIDDLE[0], AXIS[0]),
                       second = torus_distance(x, MIDDLE[1], AXIS[1]), d = others_distance(x);
                // nothing else near the tori
                if (fmin(first, second) < 1.5) d = 1;
                if (tori) d = fmin(d, fmin(first, second));
                const double share = fmin(fmax(0.5 - d / EDGE, 0), 1),
                             noise = sdm_rng_uniform(9, (uint64_t)(to - v), 0) - 0.5;
                *to++ = (float)(share * INSIDE + (1 - share) * OUTSIDE + 800 * noise);
            }
    return v;
}

static sdm_fit_opts options(void)
{
    sdm_fit_opts o = sdm_fit_defaults();
    static double params[2];
    params[sdm_instance_param_index(torus, "major")] = BIG;
    params[sdm_instance_param_index(torus, "minor")] = SMALL;
    o.start_params = params;
    return o;
}

static size_t find(const float *values, int n_threads, sdm_fit_candidate *out)
{
    const sdm_fit_source s = source();
    const sdm_fit_target t = {.kind = SDM_FIT_IMAGE, .grid = volume_grid(), .values = values};
    sdm_fit_opts o = options();
    sdm_error err = {0};
    size_t n;
    o.n_threads = n_threads;
    if (sdm_fit_find(&s, 1, &t, &o, MOST, out, &n, &err)) fail_msg("%s", err.text);
    return n;
}

static void test_tori_are_found_first(void **state)
{
    (void)state;
    float *v = volume(true);
    const sdm_grid g = volume_grid();
    sdm_fit_candidate c[MOST] = {0}, again[MOST] = {0};
    const size_t n = find(v, 1, c);
    assert_true(n >= 2);
    assert_true(c[1].score > 0.6 && (n == 2 || c[2].score < c[1].score - 0.1));
    bool found[2] = {false, false};
    for (int i = 0; i < 2; i++) {
        double r[9];
        sdm_pose_matrix(&c[i].pose, r);
        for (int t = 0; t < 2; t++) {
            double at[3], square = 0, cosine = 0, world;
            for (int a = 0; a < 3; a++) at[a] = MIDDLE[t][a] / EDGE;
            double middle[3];
            sdm_grid_world(&g, at, middle);
            for (int a = 0; a < 3; a++) {
                square += pow(c[i].pose.translation[a] - middle[a], 2);
                world = 0;
                for (int b = 0; b < 3; b++) world += g.dir[3 * a + b] * AXIS[t][b];
                cosine += world * r[3 * a + 2];
            }
            found[t] = found[t] || (sqrt(square) < 0.5 && fabs(cosine) > cos(0.2));
        }
    }
    assert_true(found[0] && found[1]);
    // another number of threads
    assert_int_equal(find(v, 3, again), n);
    assert_memory_equal(c, again, sizeof c);
    free(v);
}

static void test_without_tori_scores_are_low(void **state)
{
    (void)state;
    float *v = volume(false);
    sdm_fit_candidate c[MOST];
    const size_t n = find(v, 0, c);
    for (size_t i = 0; i < n; i++) assert_true(c[i].score < 0.6);
    // nothing but bone
    for (size_t i = 0; i < (size_t)N * N * N; i++) v[i] = i % 2 ? 1250 : 1350;
    assert_int_equal(find(v, 0, c), 0);
    free(v);
}

static void test_mistakes_are_refused(void **state)
{
    (void)state;
    const sdm_fit_source s = source();
    const double points[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = points, .n_points = 3};
    const sdm_fit_opts o = options();
    sdm_fit_candidate c[1];
    size_t n;
    assert_int_equal(sdm_fit_find(&s, 1, &t, &o, 1, c, &n, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit_find(&s, 0, &t, &o, 1, c, &n, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit_find(&s, 1, &t, &o, 0, c, &n, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit_find(&s, 1, &t, &o, 1, NULL, &n, NULL), SDM_E_ARG);
    // voxels larger than the shape
    const float values[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    const sdm_fit_target coarse = {
        .kind = SDM_FIT_IMAGE,
        .grid = sdm_grid_centred((int64_t[3]){2, 2, 2}, 30, (double[3]){0, 0, 0}),
        .values = values};
    assert_int_equal(sdm_fit_find(&s, 1, &coarse, &o, 1, c, &n, NULL), SDM_E_ARG);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tori_are_found_first),
        cmocka_unit_test(test_without_tori_scores_are_low),
        cmocka_unit_test(test_mistakes_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
