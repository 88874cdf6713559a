/* Distances at many points on random meshes: the same bits as single points, in any order, for any
 * number of threads and every instruction set; compared with maps bit by bit, with brute force in
 * long double, and with signs by rays. Usage: test_exact_points [MESHES [FIRST]]
 * Tests: feature_side.c point_aids.c point_keys_avx2.c point_keys_generic.c point_order.c
 * at_points.c points_avx2.c points_avx512.c points_generic.c wide_tree.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_subject.h"
#include "sdm/internal/processor.h"

enum { POINTS = 300, ORACLE = 40 };
static uint64_t n_meshes = 200, first;

typedef struct answers {
    double distance[POINTS], gradient[POINTS][3], closest[POINTS][3];
    uint32_t triangle[POINTS];
} answers;

static void find(const sdm_exact *e, const double (*x)[3], size_t n, answers *a)
{
    sdm_error err = {0};
    const sdm_exact_at at = {a->distance, &a->gradient[0][0], &a->closest[0][0], a->triangle};
    memset(a, 0, sizeof *a);
    if (sdm_exact_points(e, &x[0][0], n, &at, &err)) fail_msg("%s", err.text);
}

/* Fills x[POINTS]: points at which engines tend to fail, and points in twice the box. */
static void draw(subject *s, double (*x)[3])
{
    double lo[3], hi[3];
    (void)mesh_bounds(&s->mesh, lo, hi);
    for (int i = 0; i < POINTS; i++) {
        random_point(&s->mesh, &s->dice, x[i]);
        for (int a = 0; a < 3 && i % 3 == 2; a++)
            x[i][a] = 0.5 * (lo[a] + hi[a]) + s->size * roll(&s->dice, -1, 1);
    }
}

static void check_same(const subject *s, const double *x, const answers *a, size_t i,
                       const answers *b, size_t k, const char *what)
{
    CHECK(!memcmp(&a->distance[i], &b->distance[k], sizeof *a->distance), s, x,
          "%s: %.17g, not %.17g", what, b->distance[k], a->distance[i]);
    CHECK(!memcmp(a->gradient[i], b->gradient[k], sizeof *a->gradient) &&
              !memcmp(a->closest[i], b->closest[k], sizeof *a->closest) &&
              a->triangle[i] == b->triangle[k],
          s, x, "%s: another nearest point, gradient or triangle", what);
}

/* Other orders, subsets, threads and instruction sets. */
static void check_invariance(subject *s, const double (*x)[3], const answers *a)
{
    double y[POINTS][3];
    size_t from[POINTS];
    answers b;
    // shuffled, and cut into two calls
    for (size_t i = 0; i < POINTS; i++) from[i] = i;
    for (size_t i = POINTS - 1; i > 0; i--) {
        const size_t k = pick(&s->dice, i + 1), swap = from[i];
        from[i] = from[k];
        from[k] = swap;
    }
    for (size_t i = 0; i < POINTS; i++) memcpy(y[i], x[from[i]], sizeof y[i]);
    find(s->engine, (const double(*)[3])y, POINTS, &b);
    for (size_t i = 0; i < POINTS; i++) check_same(s, y[i], a, from[i], &b, i, "shuffled");
    find(s->engine, (const double(*)[3])y, 37, &b);
    for (size_t i = 0; i < 37; i++) check_same(s, y[i], a, from[i], &b, i, "a few of them");
    // single points
    for (size_t i = 0; i < POINTS; i++) {
        b.distance[i] =
            sdm_exact_point(s->engine, x[i], b.closest[i], b.gradient[i], &b.triangle[i]);
        check_same(s, x[i], a, i, &b, i, "one by one");
        CHECK(sdm_exact_distance(s->engine, x[i]) == fabs(a->distance[i]), s, x[i],
              "sdm_exact_distance");
    }
    for (int level = SDM_PROCESSOR_BASELINE; level < SDM_PROCESSOR_AVX512VNNI; level++) {
        if (sdm_processor_select(level) != level) continue;
        find(s->engine, x, POINTS, &b);
        for (size_t i = 0; i < POINTS; i++) check_same(s, x[i], a, i, &b, i, "instruction set");
        for (size_t i = 0; i < POINTS; i++) {
            b.distance[i] =
                sdm_exact_point(s->engine, x[i], b.closest[i], b.gradient[i], &b.triangle[i]);
            check_same(s, x[i], a, i, &b, i, "instruction set, one by one");
        }
    }
    sdm_processor_select(-1);
}

/* Brute force in long double; the sign by the winding number. */
static void check_truth(const subject *s, const double *x, const answers *a, size_t i)
{
    const double d = a->distance[i],
                 truth = (double)brute_distance(sdm_exact_surface(s->engine), x),
                 tolerance = bound * rounding_at(s, x);
    CHECK(fabs(fabs(d) - truth) <= tolerance, s, x, "%.17g, brute force %.17g", d, truth);
    const double seam = tolerance + s->report->union_error_mm;
    const bool certain = s->report->audit.closed
                             ? (double)brute_distance(&s->mesh, x) > seam
                             : truth > open_margin * s->size &&
                                   fabsl(brute_winding(&s->mesh, point_of(x)) - 0.5L) > 1e-9L;
    if (certain)
        CHECK((d < 0) == truly_inside(s, point_of(x)), s, x, "%.17g has the wrong sign", d);
}

static void test_points(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        double x[POINTS][3];
        static answers a;
        subject_make(&s, i, &(sdm_exact_opts){.n_threads = 1, .keep_overlap = i % 7 == 6});
        draw(&s, x);
        find(s.engine, (const double(*)[3])x, POINTS, &a);
        check_invariance(&s, (const double(*)[3])x, &a);
        for (size_t k = 0; k < ORACLE; k++) check_truth(&s, x[k], &a, k);
        subject_dispose(&s);
    }
}

/* At the centres of voxels, whose coordinates are exact in double, the values of maps. */
static void test_points_match_maps(void **state)
{
    (void)state;
    sdm_error err = {0};
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        bool exact;
        const sdm_grid g = random_grid(&s, &exact);
        const size_t n = exact ? sdm_grid_count(&g) : 0;
        float *map = exact ? map_of(&s, s.engine, &g) : NULL;
        double *x = malloc((3 * n + 1) * sizeof *x), *d = malloc((n + 1) * sizeof *d);
        for (size_t k = 0; k < n; k++) voxel(&g, k, &x[3 * k]);
        if (sdm_exact_points(s.engine, x, n, &(sdm_exact_at){.distance = d}, &err))
            fail_msg("%s", err.text);
        for (size_t k = 0; k < n; k++) {
            const bool on_surface =
                fabs(d[k]) <= bound * rounding_at(&s, &x[3 * k]) + 2 * s.report->union_error_mm;
            CHECK((float)d[k] == map[k] || (on_surface && (float)d[k] == -map[k]), &s, &x[3 * k],
                  "%.9g, in the map %.9g", d[k], (double)map[k]);
        }
        free(map);
        free(x);
        free(d);
        subject_dispose(&s);
    }
}

/* Many points: threads, chunks of any size, points that are not numbers. */
static void test_many_points(void **state)
{
    (void)state;
    enum { N = 30011 };
    sdm_error err = {0};
    subject s;
    subject_make(&s, 3, NULL);
    double *x = malloc(3 * N * sizeof *x), *d[3];
    for (size_t i = 0; i < 3 * N; i++) x[i] = s.size * roll(&s.dice, -1, 1);
    x[3 * 5] = NAN;
    x[3 * 6 + 1] = INFINITY;
    x[3 * 7 + 2] = -1e151;
    for (int t = 0; t < 3; t++) {
        sdm_exact *e = engine_of(&s, &s.mesh, &(sdm_exact_opts){.n_threads = t + 1});
        d[t] = malloc(N * sizeof **d);
        if (sdm_exact_points(e, x, N, &(sdm_exact_at){.distance = d[t]}, &err))
            fail_msg("%s", err.text);
        assert_memory_equal(d[0], d[t], N * sizeof **d);
        sdm_exact_free(e);
    }
    for (size_t i = 0; i < N; i++) {
        if (i >= 5 && i <= 7)
            assert_true(isnan(d[0][i]));
        else
            assert_true(d[0][i] == sdm_exact_point(s.engine, &x[3 * i], NULL, NULL, NULL));
    }
    uint32_t triangle[8];
    double q[8][3];
    assert_int_equal(sdm_exact_points(s.engine, x, 8,
                                      &(sdm_exact_at){.closest = &q[0][0], .triangle = triangle},
                                      &err),
                     SDM_OK);
    assert_true(triangle[5] == UINT32_MAX && isnan(q[6][0]) && isnan(q[7][2]) && !isnan(q[4][0]));
    assert_int_equal(sdm_exact_points(s.engine, NULL, 0, &(sdm_exact_at){.distance = d[0]}, &err),
                     SDM_OK);
    assert_int_equal(sdm_exact_points(s.engine, NULL, 1, &(sdm_exact_at){.distance = d[0]}, &err),
                     SDM_E_ARG);
    for (int t = 0; t < 3; t++) free(d[t]);
    free(x);
    subject_dispose(&s);
}

/* Many points for each triangle, most of them near the surface, so that vectors of two registers
 * are searched: as one by one, by every instruction set. */
static void test_dense_points(void **state)
{
    (void)state;
    enum { N = 4000 };
    sdm_error err = {0};
    static double x[N][3], distance[N];
    static uint32_t triangle[N];
    for (uint64_t i = first; i < first + n_meshes; i += 8) {
        subject s;
        subject_make(&s, i, NULL);
        for (size_t k = 0; k < N; k++) {
            random_point(&s.mesh, &s.dice, x[k]);
            for (int a = 0; a < 3; a++)
                x[k][a] += (k % 4 ? 0.02 : 1) * s.size * roll(&s.dice, -1, 1);
        }
        for (int level = SDM_PROCESSOR_BASELINE; level < SDM_PROCESSOR_AVX512VNNI; level++) {
            if (sdm_processor_select(level) != level) continue;
            if (sdm_exact_points(s.engine, &x[0][0], N,
                                 &(sdm_exact_at){.distance = distance, .triangle = triangle}, &err))
                fail_msg("%s", err.text);
            for (size_t k = 0; k < N; k++) {
                uint32_t nearest;
                const double d = sdm_exact_point(s.engine, x[k], NULL, NULL, &nearest);
                CHECK(distance[k] == d && triangle[k] == nearest, &s, x[k],
                      "%.17g to triangle %u, one by one %.17g to %u", distance[k], triangle[k], d,
                      nearest);
            }
        }
        sdm_processor_select(-1);
        subject_dispose(&s);
    }
}

/* Memory limit and cancellation. */
static bool stop_now(void *user) { return *(bool *)user; }
static void test_limits(void **state)
{
    (void)state;
    sdm_error err = {0};
    subject s;
    bool stop = false;
    subject_make(&s, 1, NULL);
    sdm_exact *e = engine_of(
        &s, &s.mesh,
        &(sdm_exact_opts){
            .memory_limit = (size_t)8 << 20, .n_threads = 1, .cancelled = stop_now, .user = &stop});
    const size_t n = (size_t)1 << 20;
    double *x = calloc(3 * n, sizeof *x), *d = malloc(n * sizeof *d);
    const sdm_exact_at at = {.distance = d};
    assert_int_equal(sdm_exact_points(e, x, n, &at, &err), SDM_E_NOMEM);
    assert_int_equal(sdm_exact_points(e, x, 1000, &at, &err), SDM_OK);
    stop = true;
    assert_int_equal(sdm_exact_points(e, x, 1000, &at, &err), SDM_E_CANCELLED);
    free(x);
    free(d);
    sdm_exact_free(e);
    subject_dispose(&s);
}

int main(int argc, char **argv)
{
    subject_range(argc, argv, &n_meshes, &first);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points),      cmocka_unit_test(test_points_match_maps),
        cmocka_unit_test(test_many_points), cmocka_unit_test(test_dense_points),
        cmocka_unit_test(test_limits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
