/* The exact engine on random meshes compared with brute force in long double: distances, signs,
 * nearest points, maps, threads, instruction sets. Usage: test_exact_random [MESHES [FIRST]]
 * Tests: feature_groups_avx2.c feature_groups_generic.c grid_distance.c map_avx2.c map_avx512.c
 * map_generic.c nearest.c feature_build.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_subject.h"
#include "sdm/internal/processor.h"

enum { POINTS = 100 };
static uint64_t n_meshes = 330, first;

static double worst; // largest error of a distance, in units of rounding_at()

static void check_nearest(const subject *s, const double x[3], double d, const double q[3],
                          const double n[3], uint32_t t)
{
    const sdm_mesh *used = sdm_exact_surface(s->engine);
    const double tolerance = bound * rounding_at(s, x);
    CHECK(t < used->n_tri, s, x, "triangle %u of %zu", (unsigned)t, used->n_tri);
    const point p = point_of(x), o = point_of(q), a = corner_of(used, 3 * (size_t)t),
                b = corner_of(used, 3 * (size_t)t + 1), c = corner_of(used, 3 * (size_t)t + 2);
    CHECK(fabsl(distance(p, o) - fabs(d)) <= tolerance, s, x, "%.17g, nearest point at %.17Lg", d,
          distance(p, o));
    CHECK(distance(o, closest_on_triangle(o, a, b, c)) <= tolerance, s, x,
          "nearest point not on its triangle");
    // the direction of a very short vector is dominated by rounding
    if (fabs(d) > 1e3 * tolerance) {
        CHECK(fabsl(length(point_of(n)) - 1) <= 2 * tolerance / fabs(d) + 4 * DBL_EPSILON, s, x,
              "normal of length %.17Lg", length(point_of(n)));
        const point way = minus(p, o);
        CHECK(dot(way, point_of(n)) * (d < 0 ? -1 : 1) > 0, s, x, "normal against the gradient");
    }
}

/* Is x, at distance `truth` from the surface, far enough from any change of sign that rounding
 * cannot affect the expected sign? */
static bool sign_is_certain(const subject *s, const double x[3], double truth, double rounding)
{
    if (s->report->audit.closed) return truth > rounding;
    return truth > open_margin * s->size &&
           fabsl(brute_winding(&s->mesh, point_of(x)) - 0.5L) > 1e-9L;
}

static void check_point(const subject *s, const sdm_exact *all, const double x[3])
{
    double q[3], n[3];
    uint32_t t;
    const double d = sdm_exact_point(s->engine, x, q, n, &t), unit = rounding_at(s, x);
    const double truth = (double)brute_distance(&s->mesh, x), tolerance = bound * unit;
    const double seam = tolerance + s->report->union_error_mm;
    CHECK(fabs(d) >= truth - seam, s, x, "%.17g, nearer than every triangle: %.17g", d, truth);
    // where buried surface does not matter: no union, no buried parts, or a point outside of the
    // solid
    const surface_kind kind = s->family->kind;
    if (!s->report->unioned || kind == SURFACE_BOUNDARY ||
        (kind == SURFACE_OVERLAP && d > 0 && truth > seam))
        CHECK(fabs(d) <= truth + seam, s, x, "%.17g, brute force %.17g", d, truth);
    const double whole = sdm_exact_point(all, x, NULL, NULL, NULL);
    CHECK(fabs(fabs(whole) - truth) <= tolerance, s, x, "%.17g with all surface, brute force %.17g",
          whole, truth);
    worst = fmax(worst, fabs(fabs(whole) - truth) / unit);
    if (sign_is_certain(s, x, truth, seam)) {
        const bool in = truly_inside(s, point_of(x));
        CHECK((d < 0) == in && (whole < 0) == in, s, x, "%.17g, but the winding number says %s", d,
              in ? "inside" : "outside");
    }
    check_nearest(s, x, d, q, n, t);
}

static void test_points_match_brute_force(void **state)
{
    (void)state;
    worst = 0;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        sdm_exact *all = engine_of(&s, &s.mesh, &(sdm_exact_opts){.keep_overlap = true});
        if (s.family->kind != SURFACE_OPEN) assert_true(s.report->audit.closed);
        for (int k = 0; k < POINTS; k++) {
            double x[3];
            random_point(&s.mesh, &s.dice, x);
            check_point(&s, all, x);
        }
        sdm_exact_free(all);
        subject_dispose(&s);
    }
    print_message("largest error of a distance: %.2f roundings\n", worst);
}

static size_t n_voxels, n_unequal;

/* The map must agree with sdm_exact_point() and be 1-Lipschitz: neighbouring voxels differ by at
 * most the spacing. */
static void check_map(const subject *s, const sdm_grid *g, const float *v, bool exact)
{
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)(g->n[0] * g->n[1])}, n = sdm_grid_count(g);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        voxel(g, i, x);
        const double d = sdm_exact_point(s->engine, x, NULL, NULL, NULL),
                     tolerance = bound * rounding_at(s, x);
        n_voxels++;
        n_unequal += fabsf(v[i]) != fabsf((float)d);
        // The map computes distances in another order and, unless `exact`, also rounds the voxel's
        // position: the value may be the float of any distance within `room`.
        const double room = (exact ? 2 : 4) * rounding_at(s, x);
        CHECK(fabsf(v[i]) >= (float)(fabs(d) - room) && fabsf(v[i]) <= (float)(fabs(d) + room), s,
              x, "voxel %zu: %.9g, point %.17g", i, (double)v[i], d);
        // the sign of a row is computed in index coordinates, for which the vertices are rounded
        // once more
        if (sign_is_certain(s, x, fabs(d), 4 * tolerance))
            CHECK((v[i] < 0) == (d < 0), s, x, "voxel %zu: %.9g, point %.17g", i, (double)v[i], d);
        for (int a = 0; a < 3; a++) {
            if (i / step[a] % (size_t)g->n[a] + 1 >= (size_t)g->n[a]) continue;
            double here = v[i], next = v[i + step[a]];
            if (!s->report->audit.closed) { // the sign of an open mesh may change anywhere in space
                here = fabs(here);
                next = fabs(next);
            }
            const double most =
                g->spacing[a] + 2 * tolerance + FLT_EPSILON / 2 * (fabs(here) + fabs(next));
            CHECK(fabs(here - next) <= most, s, x, "voxel %zu: %.9g, the next along %c %.9g", i,
                  here, "xyz"[a], next);
        }
    }
}

static void test_maps_match_points(void **state)
{
    (void)state;
    n_voxels = n_unequal = 0;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, &(sdm_exact_opts){.n_threads = 1});
        bool exact;
        const sdm_grid g = random_grid(&s, &exact);
        float *v = map_of(&s, s.engine, &g);
        check_map(&s, &g, v, exact);
        free(v);
        subject_dispose(&s);
    }
    print_message("%zu of %zu voxels are not the rounded distance of the point\n", n_unequal,
                  n_voxels);
}

static void test_threads_and_instruction_sets_give_same_bits(void **state)
{
    (void)state;
    const int best = sdm_processor_select(-1);
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, &(sdm_exact_opts){.n_threads = 1});
        bool exact;
        const sdm_grid g = random_grid(&s, &exact);
        float *one = map_of(&s, s.engine, &g);
        for (int threads = 1; threads <= 3; threads++) {
            sdm_exact *e = engine_of(&s, &s.mesh, &(sdm_exact_opts){.n_threads = threads});
            for (int level = 0; level <= best; level++) {
                assert_int_equal(sdm_processor_select(level), level);
                float *v = map_of(&s, e, &g);
                for (size_t k = 0; k < sdm_grid_count(&g); k++)
                    if (memcmp(&v[k], &one[k], sizeof *v))
                        fail_msg("mesh %u, %s, voxel %zu: %.9g with %d threads and instruction set "
                                 "%d, else %.9g",
                                 (unsigned)i, s.family->name, k, (double)v[k], threads, level,
                                 (double)one[k]);
                free(v);
            }
            sdm_exact_free(e);
        }
        (void)sdm_processor_select(-1);
        free(one);
        subject_dispose(&s);
    }
}

int main(int argc, char **argv)
{
    subject_range(argc, argv, &n_meshes, &first);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_points_match_brute_force),
        cmocka_unit_test(test_maps_match_points),
        cmocka_unit_test(test_threads_and_instruction_sets_give_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
