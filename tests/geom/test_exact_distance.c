/* Distances of the exact engine, compared with brute force and closed forms: single points, maps,
 * numbers of threads, instruction sets, scales, invalid arguments, cancellation.
 * Tests: brute_force.c cancel.c exact.c */
#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/exact_tools.h"
#include "sdm/exact.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"

static const double zero[3] = {0, 0, 0};

static double uniform(uint64_t stream, uint64_t i, double lo, double hi)
{
    return lo + (hi - lo) * sdm_rng_uniform(7, stream, i);
}

static float *map_of(const sdm_exact *e, const sdm_grid *g)
{
    sdm_error err = {0};
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    if (!v || sdm_exact_map(e, g, v, &err)) fail_msg("%s", err.text);
    return v;
}

/* Requires abs(abs(map) - abs(brute force)) <= absolute + rounding to float, and equal signs where
 * abs(distance) exceeds this limit. */
static void compare_with_brute_force(const float *map, const sdm_mesh *m, const sdm_grid *g,
                                     double absolute)
{
    for (size_t i = 0; i < sdm_grid_count(g); i++) {
        const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
        const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
        double x[3];
        sdm_grid_world(g, index, x);
        const double d = sdm_naive_point(m, x), limit = absolute + fabs(d) * 1.2e-7;
        if (!(fabs(fabs(map[i]) - fabs(d)) <= limit))
            fail_msg("voxel %zu: %.9g, brute force %.17g", i, (double)map[i], d);
        if (fabs(d) > limit && (map[i] < 0) != (d < 0))
            fail_msg("voxel %zu: %.9g, brute force %.17g", i, (double)map[i], d);
    }
}

/* A mesh of n random triangles; about half of them are of zero area, needles, or on a coarse
 * lattice (so that some coincide or are coplanar). */
static void mesh_random_triangles(sdm_mesh *m, size_t n, uint64_t seed)
{
    mesh_make(m, 3 * n, n);
    for (size_t t = 0; t < n; t++) {
        double v[3][3];
        for (size_t k = 0; k < 9; k++) v[k / 3][k % 3] = uniform(seed, 16 * t + k, -1, 1);
        const uint64_t kind = sdm_rng_below(7, seed, 16 * t + 9, 8);
        for (int a = 0; a < 3; a++) {
            if (kind == 0) v[1][a] = v[0][a];           // a segment
            if (kind == 1) v[1][a] = v[2][a] = v[0][a]; // a point
            if (kind == 2)
                // three collinear points, to rounding
                v[2][a] = v[0][a] + 0.375 * (v[1][a] - v[0][a]);
            if (kind == 3) v[2][a] = v[0][a] + 1e-7 * v[2][a]; // a needle
            if (kind == 4)
                v[0][a] = floor(4 * v[0][a]) / 4, v[1][a] = floor(4 * v[1][a]) / 4,
                v[2][a] = floor(4 * v[2][a]) / 4;
        }
        for (size_t k = 0; k < 3; k++) mesh_vertex(m, 3 * t + k, v[k][0], v[k][1], v[k][2]);
        mesh_triangle(m, t, 3 * t, 3 * t + 1, 3 * t + 2);
    }
}

static void random_rotation(uint64_t seed, double dir[9])
{
    double q[4];
    for (uint64_t i = 0; i < 4; i++) q[i] = uniform(seed, i, -1, 1);
    quaternion_rotation(q, dir);
}

static void test_random_triangles_match_brute_force(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 60; round++) {
        sdm_mesh m = {0};
        mesh_random_triangles(&m, 1 + sdm_rng_below(7, 1000, round, 60), 100 + round);
        sdm_exact *e = engine(&m, &(sdm_exact_opts){.n_threads = 1});
        for (uint64_t i = 0; i < 400; i++) {
            double x[3], q[3], n[3];
            uint32_t t;
            for (uint64_t a = 0; a < 3; a++) x[a] = uniform(200 + round, 3 * i + a, -2, 2);
            const double d = sdm_exact_point(e, x, q, n, &t), b = sdm_naive_point(&m, x);
            assert_true(fabs(fabs(d) - fabs(b)) <= 1e-13);
            assert_true((d < 0) == (b < 0));
            assert_true(t < m.n_tri);
            double r = 0, len = 0;
            for (int a = 0; a < 3; a++) {
                r += (x[a] - q[a]) * (x[a] - q[a]);
                len += n[a] * n[a];
            }
            assert_true(fabs(sqrt(r) - fabs(d)) < 1e-12 && fabs(len - 1) < 1e-9);
        }
        sdm_grid g = {.n = {1 + (int64_t)sdm_rng_below(7, 1001, round, 14),
                            1 + (int64_t)sdm_rng_below(7, 1002, round, 14),
                            1 + (int64_t)sdm_rng_below(7, 1003, round, 14)}};
        random_rotation(300 + round, g.dir);
        for (int a = 0; a < 3; a++) {
            if (round % 2) g.dir[3 * a] = -g.dir[3 * a]; // a reflection
            g.spacing[a] = uniform(400 + round, (uint64_t)a, 0.01, 0.3);
            g.origin[a] = uniform(500 + round, (uint64_t)a, -1.5, 0.5);
        }
        float *v = map_of(e, &g);
        compare_with_brute_force(v, &m, &g, 1e-12);
        free(v);
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

static void test_box_is_exact(void **state)
{
    (void)state;
    // voxels lie on vertices, edges and faces of the box and rows run along its edges: all kinds of
    // ties between features
    const double lo[3] = {0, 0, 0}, hi[3] = {1, 2, 1.5};
    sdm_mesh m = {0};
    mesh_box(&m, lo, hi);
    sdm_exact *e = engine(&m, NULL);
    const sdm_exact_report *r = sdm_exact_get_report(e);
    assert_true(r->sign == SDM_SIGN_CROSSINGS && !r->unioned && !r->turned && r->n_tri_used == 12 &&
                r->union_error_mm == 0);
    static const int turn[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1},
                                   {1, 0, 2}, {0, 2, 1}, {2, 1, 0}};
    for (int o = 0; o < 48; o++) {
        sdm_grid g = {.n = {17, 19, 23}, .spacing = {0.25, 0.125, 0.1875}};
        for (int a = 0; a < 3; a++) {
            const double s = o / 6 >> a & 1 ? -1 : 1;
            g.dir[3 * turn[o % 6][a] + a] = s;
            g.origin[turn[o % 6][a]] = s > 0 ? -1 : 3;
        }
        float *v = map_of(e, &g);
        for (int64_t i = 0; i < 17 * 19 * 23; i++) {
            const double index[3] = {(double)(i % 17), (double)(i / 17 % 19),
                                     (double)(i / 17 / 19)};
            double x[3];
            sdm_grid_world(&g, index, x);
            const double d = box_distance(x, lo, hi);
            assert_true(fabs(v[i] - d) <= 1e-15 + fabs(d) * 6e-8);
            const double point = sdm_exact_point(e, x, NULL, NULL, NULL);
            assert_true(fabs(point - d) < 1e-15 && sdm_exact_distance(e, x) == fabs(point));
        }
        free(v);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_sphere_within_sagitta(void **state)
{
    (void)state;
    const double centre[3] = {0.3, -0.2, 0.1};
    const size_t n = 40;
    sdm_mesh m = {0};
    mesh_sphere(&m, centre, 2, n);
    sdm_exact *e = engine(&m, NULL);
    const double sagitta = 2 * (1 - cos(3.14159265358979 / 2 / (double)n)) * 2.01;
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){33, 32, 31}, 0.2, zero);
    float *v = map_of(e, &g);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        const double index[3] = {(double)(i % 33), (double)(i / 33 % 32), (double)(i / 33 / 32)};
        double x[3], r = 0;
        sdm_grid_world(&g, index, x);
        for (int a = 0; a < 3; a++) r += (x[a] - centre[a]) * (x[a] - centre[a]);
        const double d = sqrt(r) - 2;
        assert_true(v[i] >= d - 1e-6 && v[i] <= d + sagitta + 1e-6);
    }
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_threads_and_instruction_sets_agree(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    const spiral s = SPIRAL_NOMINAL;
    mesh_spiral(&m, &s, 0.5);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){45, 41, 30}, 0.3, (const double[3]){0, 0, 2});
    float *first = NULL;
    const int best = sdm_processor_select(-1);
    for (int level = 0; level <= best; level++) {
        assert_int_equal(sdm_processor_select(level), level);
        for (int threads = 1; threads <= 3; threads++) {
            sdm_exact *e = engine(&m, &(sdm_exact_opts){.n_threads = threads});
            float *v = map_of(e, &g);
            // With one instruction set the bits do not depend on the number of threads; between
            // instruction sets the last bit may differ.
            if (threads == 1) {
                for (size_t i = 0; first && i < sdm_grid_count(&g); i++)
                    assert_true(fabsf(v[i] - first[i]) <= fabsf(v[i]) * 1.2e-7f);
                free(first);
                first = v;
            }
            assert_memory_equal(v, first, sdm_grid_count(&g) * sizeof *v);
            // the map agrees with sdm_exact_point()
            for (size_t i = 0; i < sdm_grid_count(&g); i += 97) {
                const double index[3] = {(double)(i % 45), (double)(i / 45 % 41),
                                         (double)(i / 45 / 41)};
                double x[3];
                sdm_grid_world(&g, index, x);
                const double d = sdm_exact_point(e, x, NULL, NULL, NULL);
                assert_true(fabs(v[i] - d) <= 1e-12 + fabs(d) * 6.1e-8);
            }
            if (v != first) free(v);
            sdm_exact_free(e);
        }
    }
    (void)sdm_processor_select(-1);
    free(first);
    sdm_mesh_dispose(&m);
}

static void test_scaling_and_shifting(void **state)
{
    (void)state;
    sdm_mesh m = {0}, far = {0};
    const spiral s = SPIRAL_NOMINAL;
    mesh_spiral(&m, &s, 0.8);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){20, 20, 14}, 0.625, (const double[3]){0, 0, 2});
    sdm_exact *e = engine(&m, NULL);
    float *v = map_of(e, &g);
    const size_t used = sdm_exact_get_report(e)->n_tri_used;
    sdm_exact_free(e);
    // scaling by a power of two scales the map exactly
    for (int exponent = -30; exponent <= 30; exponent += 15) {
        sdm_mesh_copy(&m, &far, NULL);
        sdm_grid h = g;
        for (size_t i = 0; i < 3 * far.n_vert; i++) far.vert[i] = ldexp(m.vert[i], exponent);
        for (int a = 0; a < 3; a++) {
            h.spacing[a] = ldexp(g.spacing[a], exponent);
            h.origin[a] = ldexp(g.origin[a], exponent);
        }
        e = engine(&far, NULL);
        assert_int_equal(sdm_exact_get_report(e)->n_tri_used, used);
        float *w = map_of(e, &h);
        for (size_t i = 0; i < sdm_grid_count(&g); i++) assert_true(w[i] == ldexpf(v[i], exponent));
        free(w);
        sdm_exact_free(e);
    }
    // shifted by 131072 mm along each axis
    sdm_mesh_copy(&m, &far, NULL);
    sdm_grid h = g;
    for (size_t i = 0; i < 3 * far.n_vert; i++) far.vert[i] = m.vert[i] + 131072;
    for (int a = 0; a < 3; a++) h.origin[a] = g.origin[a] + 131072;
    e = engine(&far, NULL);
    float *w = map_of(e, &h);
    for (size_t i = 0; i < sdm_grid_count(&g); i++)
        assert_true(fabs(w[i] - v[i]) < 1e-9 + fabs(v[i]) * 1.2e-7);
    free(w);
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&far);
}

static void test_thin_grids_and_single_voxels(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, zero, 1, 12);
    sdm_exact *e = engine(&m, NULL);
    static const int64_t sizes[8][3] = {{1, 1, 1},   {100, 1, 1}, {1, 100, 1}, {1, 1, 100},
                                        {1, 40, 41}, {40, 1, 41}, {40, 41, 1}, {2, 65, 3}};
    for (int i = 0; i < 8; i++) {
        sdm_grid g = sdm_grid_centred(sizes[i], 0.07, (const double[3]){0.11, 0.2, -0.3});
        g.spacing[i % 3] = 0.003;
        float *v = map_of(e, &g);
        compare_with_brute_force(v, &m, &g, 1e-13);
        free(v);
    }
    // voxels much larger than the mesh, then a grid much smaller than the mesh
    const sdm_grid wide =
        sdm_grid_centred((const int64_t[3]){9, 10, 11}, 1e4, (const double[3]){1, 2, 3});
    const sdm_grid tiny =
        sdm_grid_centred((const int64_t[3]){9, 10, 11}, 1e-6, (const double[3]){1, 0, 0});
    float *v = map_of(e, &wide);
    compare_with_brute_force(v, &m, &wide, 1e-12);
    free(v);
    v = map_of(e, &tiny);
    compare_with_brute_force(v, &m, &tiny, 1e-13);
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_distance_is_1_lipschitz(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    const spiral s = SPIRAL_NOMINAL;
    mesh_spiral(&m, &s, 0.4);
    sdm_exact *e = engine(&m, NULL);
    for (uint64_t i = 0; i < 4000; i++) {
        double x[3], y[3], n[3];
        for (uint64_t a = 0; a < 3; a++) {
            x[a] = uniform(31, 3 * i + a, -6, 6);
            y[a] = x[a] + uniform(32, 3 * i + a, -0.05, 0.05);
        }
        const double dx = sdm_exact_point(e, x, NULL, n, NULL),
                     dy = sdm_exact_point(e, y, NULL, NULL, NULL);
        double apart = 0;
        for (int a = 0; a < 3; a++) apart += (x[a] - y[a]) * (x[a] - y[a]);
        assert_true(fabs(dx - dy) <= sqrt(apart) + 1e-12);
        // a step h towards the surface, along the normal, reduces the distance by h unless another
        // part of the surface is nearer
        const double h = 1e-6;
        for (int a = 0; a < 3; a++) y[a] = x[a] - h * n[a] * (dx > 0 ? 1 : -1);
        if (fabs(dx) > 1e-3)
            assert_true(fabs(fabs(sdm_exact_point(e, y, NULL, NULL, NULL)) - (fabs(dx) - h)) <
                        1e-11);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static bool cancel_after_calls(void *user) { return ++*(int *)user >= 0; }

/* The callback `cancelled` requests a stop at its n-th call, for n = 1, 2, ...: each time the
 * preparation of a mesh that needs a union must stop with SDM_E_CANCELLED and free its memory. */
static void test_preparation_can_be_cancelled(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, zero, 1, 6);
    mesh_sphere(&b, (const double[3]){1, 0.1, 0}, 1, 6);
    mesh_append(&m, &b);
    sdm_exact *e = NULL;
    for (int n = 1; !e; n++) {
        int calls = -n;
        sdm_error err = {0};
        const sdm_status s = sdm_exact_create(
            &m, &(sdm_exact_opts){.cancelled = cancel_after_calls, .user = &calls}, &e, &err);
        assert_int_equal(s, calls < 0 ? SDM_OK : SDM_E_CANCELLED);
        assert_true(calls <= 0 && (s == SDM_OK) == (e != NULL));
        if (s) assert_string_equal(err.text, "preparation of the mesh stopped on request");
        if (e) assert_true(n > 50);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

static void test_invalid_arguments_and_limits(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_exact *e = NULL;
    sdm_error err = {0};
    assert_int_equal(sdm_exact_create(&m, NULL, &e, &err), SDM_E_MESH);
    assert_null(e);
    assert_int_equal(sdm_exact_create(NULL, NULL, &e, &err), SDM_E_ARG);
    mesh_box(&m, zero, (const double[3]){1, 1, 1});
    m.vert[4] = INFINITY;
    assert_int_equal(sdm_exact_create(&m, NULL, &e, &err), SDM_E_MESH);
    mesh_box(&m, zero, (const double[3]){1, 1, 1});
    m.tri[0] = 99;
    assert_int_equal(sdm_exact_create(&m, NULL, &e, &err), SDM_E_MESH);
    mesh_box(&m, zero, (const double[3]){1, 1, 1});
    assert_int_equal(sdm_exact_create(&m, &(sdm_exact_opts){.sign = (sdm_sign_method)9}, &e, &err),
                     SDM_E_ARG);
    assert_int_equal(sdm_exact_create(&m, &(sdm_exact_opts){.memory_limit = 100}, &e, &err),
                     SDM_E_NOMEM);
    int calls = -1000; // counts up to 0, then requests a stop
    e = engine(&m,
               &(sdm_exact_opts){.n_threads = 1, .cancelled = cancel_after_calls, .user = &calls});
    assert_true(calls > -1000 && calls < -900);
    calls = -1;
    sdm_grid g = sdm_grid_centred((const int64_t[3]){30, 30, 30}, 0.1, zero);
    float *v = malloc(sdm_grid_count(&g) * sizeof *v);
    assert_int_equal(sdm_exact_map(e, &g, v, &err), SDM_E_CANCELLED);
    assert_int_equal(calls, 0);
    assert_int_equal(sdm_exact_map(e, NULL, v, &err), SDM_E_ARG);
    g.spacing[1] = NAN;
    assert_int_equal(sdm_exact_map(e, &g, v, &err), SDM_E_ARG);
    assert_int_equal(sdm_naive_map(&m, &g, 1, v, &err), SDM_E_ARG);
    assert_int_equal(sdm_naive_map(NULL, &g, 1, v, &err), SDM_E_ARG);
    const double bad[3] = {0, NAN, 0}, odd[5] = {NAN, INFINITY, -1e151, 1e200, DBL_MAX};
    double q[3], normal[3];
    for (int i = 0; i < 15; i++) {
        const double x[3] = {i % 3 == 0 ? odd[i / 3] : 1, i % 3 == 1 ? odd[i / 3] : 2,
                             i % 3 == 2 ? odd[i / 3] : 3};
        assert_true(isnan(sdm_exact_point(e, x, q, normal, NULL)) && isnan(q[0]) &&
                    isnan(normal[0]));
        assert_true(isnan(sdm_exact_distance(e, x)));
    }
    for (double far = 1e10; far < 1e150; far *= 1e10) {
        const double x[3] = {0.5, -far, 0.5}, d = sdm_exact_point(e, x, q, normal, NULL);
        assert_true(fabs(d / far - 1) < 1e-9 && d == sdm_exact_distance(e, x) && q[1] == 0 &&
                    normal[1] < -1 + 1e-9);
    }
    assert_true(isnan(sdm_naive_point(&m, bad)));
    assert_string_equal(sdm_sign_method_name(SDM_SIGN_CROSSINGS), "crossings");
    assert_string_equal(sdm_sign_method_name((sdm_sign_method)77), "unknown");
    free(v);
    sdm_exact_free(e);
    sdm_exact_free(NULL);
    sdm_mesh_dispose(&m);
}

static void test_naive_map_matches_naive_points(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, zero, 1, 6);
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){5, 6, 7}, 0.4, zero);
    float v[5 * 6 * 7];
    assert_int_equal(sdm_naive_map(&m, &g, 2, v, NULL), SDM_OK);
    compare_with_brute_force(v, &m, &g, 0);
    assert_true(v[2 + 5 * (3 + 6 * 3)] < -0.7 && v[0] > 0.8);
    sdm_mesh_dispose(&m);
}

static void test_failed_allocations(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, zero, 1, 6);
    mesh_sphere(&b, (const double[3]){1, 0.1, 0}, 1, 6);
    mesh_append(&m, &b);
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){9, 9, 9}, 0.4, zero);
    float v[729];
    bool whole = false;
    for (unsigned long n = 1; !whole; n++) {
        sdm_error err = {0};
        sdm_exact *e = NULL;
        sdm_alloc_fail_after(n);
        sdm_status s = sdm_exact_create(&m, &(sdm_exact_opts){.n_threads = 1}, &e, &err);
        if (!s) s = sdm_exact_map(e, &g, v, &err);
        sdm_alloc_fail_after(0);
        if (s)
            assert_int_equal(s, SDM_E_NOMEM);
        else
            whole = true;
        sdm_exact_free(e);
        assert_true(n < 1000);
    }
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

/* Faces so narrow that float precision cannot decide their Voronoi regions, but that are nearest to
 * many voxels at once; for every instruction set. */
static void test_narrow_faces(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_box(&m, (const double[3]){0, 0, 0}, (const double[3]){4, 0.05, 1});
    // halfway between the boxes the wide face above is hardly farther than the narrow one below
    mesh_box(&b, (const double[3]){-1, -1, 1.2}, (const double[3]){5, 1, 1.5});
    mesh_append(&m, &b);
    sdm_exact *e = engine(&m, NULL);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){32, 8, 32}, 0.0125, (const double[3]){2, 0.025, 1.1});
    for (int level = 0; level < 3; level++) {
        (void)sdm_processor_select(level);
        float *map = map_of(e, &g);
        compare_with_brute_force(map, &m, &g, 0);
        free(map);
    }
    (void)sdm_processor_select(-1);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_random_triangles_match_brute_force),
        cmocka_unit_test(test_box_is_exact),
        cmocka_unit_test(test_sphere_within_sagitta),
        cmocka_unit_test(test_threads_and_instruction_sets_agree),
        cmocka_unit_test(test_scaling_and_shifting),
        cmocka_unit_test(test_thin_grids_and_single_voxels),
        cmocka_unit_test(test_narrow_faces),
        cmocka_unit_test(test_distance_is_1_lipschitz),
        cmocka_unit_test(test_preparation_can_be_cancelled),
        cmocka_unit_test(test_invalid_arguments_and_limits),
        cmocka_unit_test(test_naive_map_matches_naive_points),
        cmocka_unit_test(test_failed_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
