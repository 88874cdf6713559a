/* All methods of the method table: exact ones compared with brute force, approximate ones within
 * their reported error bound; several meshes and grids, numbers of threads, memory limits,
 * cancellation, invalid arguments.
 * Tests: cancel.c cells.c clock.c edt.c edt_seeds.c method_exact.c method_naive.c method_run.c
 * method_table.c octree.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/methods.h"
#include "sdm/internal/rng.h"

static double uniform(uint64_t stream, uint64_t i, double lo, double hi)
{
    return lo + (hi - lo) * sdm_rng_uniform(11, stream, i);
}

static void random_rotation(uint64_t seed, double dir[9])
{
    double q[4];
    for (uint64_t i = 0; i < 4; i++) q[i] = uniform(seed, i, -1, 1);
    quaternion_rotation(q, dir);
}

/* ---- meshes around the origin, of size 1 to 2; all but the soup are closed and do not overlap
 * ---- */

static void make_box(sdm_mesh *m)
{
    mesh_box(m, (const double[3]){-0.7, -1, -0.45}, (const double[3]){0.7, 1, 0.5});
}

static void make_sphere(sdm_mesh *m) { mesh_sphere(m, (const double[3]){0.1, 0, -0.05}, 0.9, 8); }

/* A ball with a cavity. */
static void make_shell(sdm_mesh *m)
{
    sdm_mesh inner = {0};
    mesh_sphere(m, (const double[3]){0, 0, 0}, 1, 7);
    mesh_sphere(&inner, (const double[3]){0.05, 0, 0}, 0.6, 6);
    mesh_flip(&inner);
    mesh_append(m, &inner);
    sdm_mesh_dispose(&inner);
}

static void make_torus(sdm_mesh *m)
{
    const double pi = 3.14159265358979323846;
    const size_t n = 16, k = 8;
    mesh_make(m, n * k, 2 * n * k);
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < k; j++) {
            const double a = 2 * pi * (double)i / (double)n, b = 2 * pi * (double)j / (double)k;
            const double r = 0.8 + 0.25 * cos(b);
            mesh_vertex(m, i * k + j, r * cos(a), r * sin(a), 0.25 * sin(b));
            const size_t p = (i + 1) % n * k, q = i * k, next = (j + 1) % k;
            mesh_triangle(m, 2 * (i * k + j), q + j, p + j, p + next);
            mesh_triangle(m, 2 * (i * k + j) + 1, q + j, p + next, q + next);
        }
    }
}

/* 27 random tetrahedra, from well-shaped to flat, each in its own cell of a lattice. */
static void make_tetrahedra(sdm_mesh *m)
{
    mesh_make(m, 4 * 27, 4 * 27);
    for (size_t i = 0; i < 27; i++) {
        double v[4][3];
        for (size_t k = 0; k < 12; k++)
            v[k / 3][k % 3] = 0.7 * ((double)(k % 3 == 0   ? i % 3
                                              : k % 3 == 1 ? i / 3 % 3
                                                           : i / 9) -
                                     1) +
                              uniform(50, 12 * i + k, -0.3, 0.3);
        for (size_t k = 0; k < 4; k++) mesh_vertex(m, 4 * i + k, v[k][0], v[k][1], v[k][2]);
        double e[3][3];
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++) e[k][a] = v[k + 1][a] - v[0][a];
        const double volume = e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) -
                              e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
                              e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
        static const size_t face[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
        for (size_t f = 0; f < 4; f++)
            mesh_triangle(m, 4 * i + f, 4 * i + face[f][0], 4 * i + face[f][volume > 0 ? 1 : 2],
                          4 * i + face[f][volume > 0 ? 2 : 1]);
    }
}

/* Random triangles that enclose nothing; some of them have zero area. */
static void make_soup(sdm_mesh *m)
{
    mesh_make(m, 3 * 40, 40);
    for (size_t t = 0; t < 40; t++) {
        double v[9];
        for (size_t k = 0; k < 9; k++) v[k] = uniform(60, 16 * t + k, -1, 1);
        if (t % 8 == 0) memcpy(v + 3, v, 3 * sizeof *v);
        if (t % 16 == 0) memcpy(v + 6, v, 3 * sizeof *v);
        for (size_t k = 0; k < 3; k++)
            mesh_vertex(m, 3 * t + k, v[3 * k], v[3 * k + 1], v[3 * k + 2]);
        mesh_triangle(m, t, 3 * t, 3 * t + 1, 3 * t + 2);
    }
}

static void (*const makers[])(sdm_mesh *) = {make_box,   make_sphere,     make_shell,
                                             make_torus, make_tetrahedra, make_soup};
enum { N_MESHES = sizeof makers / sizeof *makers };

/* ---- grids ---- */

enum { N_GRIDS = 8 };

static sdm_grid make_grid(int which)
{
    static const double centre[3] = {0.02, -0.03, 0.01};
    sdm_grid g = sdm_grid_centred((const int64_t[3]){19, 22, 17}, 0.14, centre);
    if (which == 0) return g;
    if (which == 1) { // anisotropic, rotated, and large enough for several root cells of the octree
        g = sdm_grid_centred((const int64_t[3]){35, 12, 18}, 0.085, centre);
        g.spacing[1] = 0.2;
        g.spacing[2] = 0.14;
        random_rotation(70, g.dir);
        sdm_grid turned = g;
        for (int a = 0; a < 3; a++) turned.origin[a] = 0;
        double middle[3];
        sdm_grid_world(&turned, (const double[3]){17, 5.5, 8.5}, middle);
        for (int a = 0; a < 3; a++) g.origin[a] = -middle[a];
    }
    if (which == 2) { // reflected and rotated
        random_rotation(71, g.dir);
        for (int a = 0; a < 3; a++) {
            g.dir[3 * a] = -g.dir[3 * a];
            g.origin[a] = uniform(72, (uint64_t)a, -1.2, -0.8);
        }
    }
    if (which == 3) g = sdm_grid_centred((const int64_t[3]){1, 25, 30}, 0.09, centre);
    if (which == 4) g = sdm_grid_centred((const int64_t[3]){40, 1, 1}, 0.05, centre);
    if (which == 5) g = sdm_grid_centred((const int64_t[3]){1, 1, 1}, 0.3, centre);
    if (which == 6) g.origin[0] += 5; // shifted by 5 mm along x: the mesh lies beside the grid
    if (which == 7)
        g = sdm_grid_centred((const int64_t[3]){9, 8, 7}, 0.2,
                             (double[3]){4, 4, 4}); // no grid line meets the mesh
    return g;
}

/* Map by method m (caller frees). NULL if the method rejects the grid, which only "edt" may do,
 * when no grid line crosses the surface. */
static float *map_of(const sdm_method *m, const sdm_mesh *mesh, const sdm_grid *g,
                     const sdm_method_opts *o, sdm_method_report *r)
{
    sdm_error err = {0};
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    assert_non_null(v);
    if (!m->map(mesh, g, o, v, r, &err)) return v;
    if (strcmp(m->name, "edt") || !strstr(err.text, "crosses the surface"))
        fail_msg("%s: %s", m->name, err.text);
    free(v);
    return NULL;
}

static double brute_force_at_voxel(const sdm_mesh *m, const sdm_grid *g, size_t i)
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    double x[3];
    sdm_grid_world(
        g, (const double[3]){(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)}, x);
    return sdm_naive_point(m, x);
}

/* Every method on every mesh and grid: the distances must be within the reported error bound, the
 * signs exact. */
static void test_error_bounds_against_brute_force(void **state)
{
    (void)state;
    for (int which = 0; which < N_MESHES; which++) {
        sdm_mesh m = {0};
        makers[which](&m);
        for (int grid = 0; grid < N_GRIDS; grid++) {
            const sdm_grid g = make_grid(grid);
            const size_t n = sdm_grid_count(&g);
            double *truth = malloc(n * sizeof *truth);
            assert_non_null(truth);
            for (size_t i = 0; i < n; i++) truth[i] = brute_force_at_voxel(&m, &g, i);
            for (size_t k = 0; k < sdm_method_count(); k++) {
                const sdm_method *method = sdm_method_at(k);
                sdm_method_report r;
                if (n > 2000 && !strcmp(method->name, "naive"))
                    continue; // the naive method is the reference itself
                float *v = map_of(method, &m, &g, NULL, &r);
                if (!v && grid != 7 && grid != 6 && grid != 5 && grid != 4)
                    fail_msg("edt refuses grid %d", grid);
                if (!v) continue;
                if (grid == 7 && !strcmp(method->name, "edt"))
                    fail_msg("edt takes a grid without seeds");
                assert_true(r.error_bound_mm >= 0 && r.ms_prepare >= 0 && r.ms_map >= 0);
                if (method->exact) assert_true(r.error_bound_mm == 0);
                for (size_t i = 0; i < n; i++) {
                    const double d = truth[i], rounding = 1e-12 + 1.2e-7 * fabs(d);
                    if (!(fabs(fabs((double)v[i]) - fabs(d)) <= r.error_bound_mm + rounding) ||
                        (fabs(d) > 1e-12 && (v[i] < 0) != (d < 0)))
                        fail_msg(
                            "%s, mesh %d, grid %d, voxel %zu: %.9g, brute force %.17g, bound %g",
                            method->name, which, grid, i, (double)v[i], d, r.error_bound_mm);
                    // edt measures to seeds on the surface: it never underestimates
                    if (!strcmp(method->name, "edt"))
                        assert_true(fabs((double)v[i]) >= fabs(d) * (1 - 1e-6) - 1e-9);
                }
                free(v);
            }
            free(truth);
        }
        sdm_mesh_dispose(&m);
    }
}

/* All methods must treat overlapping, inside-out and open meshes and the options keep_overlap and
 * sign in the same way as the method "exact": same surface, same signs. */
static void test_methods_agree_on_surface_and_sign(void **state)
{
    (void)state;
    const sdm_grid g = make_grid(1);
    for (int which = 0; which < 5; which++) {
        sdm_mesh m = {0}, other = {0};
        mesh_sphere(&m, (const double[3]){-0.3, 0, 0}, 0.7, 10);
        mesh_sphere(&other, (const double[3]){0.4, 0.1, 0}, 0.6, 9);
        mesh_append(&m, &other);
        if (which == 1) mesh_flip(&m);
        if (which == 2) m.n_tri -= 40; // open
        const sdm_method_opts o = {.exact.keep_overlap = which == 3,
                                   .exact.sign = which == 4 ? SDM_SIGN_WINDING : SDM_SIGN_AUTO};
        sdm_method_report r;
        float *exact = map_of(sdm_method_at(0), &m, &g, &o, &r);
        assert_true(r.exact.unioned == (which != 2 && which != 3));
        assert_true(r.exact.turned == (which == 1));
        for (size_t k = 1; k < sdm_method_count(); k++) {
            const sdm_method *method = sdm_method_at(k);
            if (!strcmp(method->name, "naive")) continue;
            float *v = map_of(method, &m, &g, &o, &r);
            assert_non_null(v);
            for (size_t i = 0; i < sdm_grid_count(&g); i++) {
                assert_true(fabsf(fabsf(v[i]) - fabsf(exact[i])) <=
                            r.error_bound_mm + 2.4e-7 * fabsf(exact[i]));
                assert_true((v[i] < 0) == (exact[i] < 0));
            }
            free(v);
        }
        free(exact);
        sdm_mesh_dispose(&m);
        sdm_mesh_dispose(&other);
    }
}

/* The octree keeps the requested error bound, and interpolates where the bound allows it. */
static void test_octree_keeps_error_bound(void **state)
{
    (void)state;
    const sdm_method *octree = sdm_method_find("octree", NULL);
    sdm_mesh m = {0};
    make_torus(&m);
    sdm_grid g = make_grid(1);
    g.spacing[0] = g.spacing[1] = g.spacing[2] = 0.2;
    for (int i = 0; i < 4; i++) {
        const double requested[4] = {0, 1e-9, 0.03, 0.3};
        sdm_method_report r;
        float *v = map_of(octree, &m, &g, &(sdm_method_opts){.max_error_mm = requested[i]}, &r);
        assert_true(r.error_bound_mm == (i == 0 ? 0.05 * 0.2 : requested[i]));
        double worst = 0;
        for (size_t k = 0; k < sdm_grid_count(&g); k++)
            worst = fmax(worst, fabs((double)v[k] - brute_force_at_voxel(&m, &g, k)));
        assert_true(worst <= r.error_bound_mm + 1e-6);
        if (requested[i] >= 0.03) assert_true(worst > 0.1 * requested[i]); // interpolation was used
        free(v);
    }
    sdm_mesh_dispose(&m);
}

/* A small ball that lies between the grid lines has no seeds, so "edt" misses it; its reported
 * error bound must cover the resulting error, unless the ball is too far away to matter. */
static void test_edt_bound_covers_missed_parts(void **state)
{
    (void)state;
    const sdm_method *edt = sdm_method_find("edt", NULL);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){30, 30, 30}, 0.1, (const double[3]){0, 0, 0});
    // positions of the small ball: between grid lines; outside of the grid near a corner; so far
    // away that no voxel is nearest to it
    const double place[3][3] = {{1, 0.7, 0.7}, {1.6, 1.6, 1.6}, {50, 50, 50}},
                 radius[3] = {0.03, 0.1, 1};
    sdm_error err = {0};
    sdm_method_report seen, unseen;
    for (int i = 0; i < 3; i++) {
        sdm_mesh m = {0}, speck = {0};
        mesh_sphere(&m, (const double[3]){-0.5, 0, 0}, 0.4, 16);
        mesh_sphere(&speck, place[i], radius[i], 6);
        free(map_of(edt, &m, &g, NULL, &seen));
        assert_true(seen.error_bound_mm < 0.15); // 1.5 voxels
        mesh_append(&m, &speck);
        float *v = map_of(edt, &m, &g, NULL, &unseen);
        assert_non_null(v);
        double worst = 0;
        for (size_t k = 0; k < sdm_grid_count(&g); k += 7) // places all over the grid of 30^3
            worst = fmax(worst, fabs(fabs((double)v[k]) - fabs(brute_force_at_voxel(&m, &g, k))));
        assert_true(worst <= unseen.error_bound_mm && unseen.error_bound_mm < worst + 0.6);
        assert_true(i == 2 ? unseen.error_bound_mm == seen.error_bound_mm : worst > 1);
        assert_int_equal(edt->map(&speck, &g, NULL, v, NULL, &err), SDM_E_ARG);
        assert_non_null(strstr(err.text, "no line of voxel centres of the 30 x 30 x 30 grid"));
        free(v);
        sdm_mesh_dispose(&m);
        sdm_mesh_dispose(&speck);
    }
}

static void test_threads_give_same_bits(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    const spiral s = SPIRAL_NOMINAL;
    mesh_spiral(&m, &s, 0.8);
    sdm_grid g = sdm_grid_centred((const int64_t[3]){50, 40, 36}, 0.25, (const double[3]){0, 0, 2});
    const size_t bytes = sdm_grid_count(&g) * sizeof(float);
    for (size_t k = 0; k < sdm_method_count(); k++) {
        const sdm_method *method = sdm_method_at(k);
        if (!strcmp(method->name, "naive")) g.n[2] = 2; // this method is slow
        sdm_method_report one, r;
        float *reference = map_of(method, &m, &g, &(sdm_method_opts){.exact.n_threads = 1}, &one);
        for (int n = 2; n <= 5; n += 3) {
            float *v = map_of(method, &m, &g, &(sdm_method_opts){.exact.n_threads = n}, &r);
            assert_memory_equal(v, reference, sdm_grid_count(&g) * sizeof *v);
            assert_true(r.error_bound_mm == one.error_bound_mm && !strcmp(r.note, one.note));
            free(v);
        }
        free(reference);
        g.n[2] = 36;
        assert_true(bytes == sdm_grid_count(&g) * sizeof(float));
    }
    sdm_mesh_dispose(&m);
}

typedef struct watcher {
    double share;
    int calls, patience;
} watcher;

static bool cancel_when_patience_ends(void *user) { return --((watcher *)user)->patience < 0; }

static void progress_record(void *user, double share)
{
    watcher *w = user;
    assert_true(share > 0 && share <= 1 + 1e-12);
    w->share = share;
    w->calls++;
}

static void test_cancellation_and_memory_limits(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    make_torus(&m);
    const sdm_grid g = make_grid(0);
    float *v = malloc(sdm_grid_count(&g) * sizeof *v);
    assert_non_null(v);
    for (size_t k = 0; k < sdm_method_count(); k++) {
        const sdm_method *method = sdm_method_at(k);
        sdm_method_report r, untouched;
        sdm_error err = {0};
        watcher w = {.patience = 1 << 30};
        sdm_method_opts o = {
            .exact = {.n_threads = 1, .user = &w, .cancelled = cancel_when_patience_ends},
            .progress = progress_record};
        assert_int_equal(method->map(&m, &g, &o, v, &r, &err), SDM_OK);
        if (strcmp(method->name, "exact")) assert_true(w.calls > 0 && fabs(w.share - 1) < 1e-12);
        // the slow method reports its progress after every row
        if (!strcmp(method->name, "naive")) assert_int_equal(w.calls, g.n[1] * g.n[2]);
        memset(&untouched, 7, sizeof untouched);
        w.patience = 0;
        assert_int_equal(method->map(&m, &g, &o, v, &untouched, &err), SDM_E_CANCELLED);
        assert_true(untouched.bytes == 0x0707070707070707u);
        o.exact.cancelled = NULL;
        if (!strcmp(method->name, "naive")) continue;
        o.exact.memory_limit = 1000;
        assert_int_equal(method->map(&m, &g, &o, v, &r, &err), SDM_E_NOMEM);
        assert_non_null(strstr(err.text, "memory_limit"));
        // the reported number of bytes is the smallest sufficient memory_limit of the octree with 8
        // threads; the engine needs less than that
        o.exact.memory_limit = 0;
        o.exact.n_threads = 8;
        assert_int_equal(method->map(&m, &g, &o, v, &r, &err), SDM_OK);
        if (!strcmp(method->name, "octree")) {
            o.exact.memory_limit = r.bytes;
            assert_int_equal(method->map(&m, &g, &o, v, &r, &err), SDM_OK);
            o.exact.memory_limit = r.bytes - 1;
            assert_int_equal(method->map(&m, &g, &o, v, &r, &err), SDM_E_NOMEM);
            assert_non_null(strstr(err.text, "use method exact"));
        }
        o.exact.n_threads = 1;
        // every single allocation may fail
        o.exact.memory_limit = 0;
        sdm_status s = SDM_E_NOMEM;
        unsigned long n = 1;
        for (; s && n < 1000; n++) {
            sdm_alloc_fail_after(n);
            s = method->map(&m, &g, &o, v, &r, &err);
            assert_true(s == SDM_OK || s == SDM_E_NOMEM);
        }
        sdm_alloc_fail_after(0);
        assert_true(n > 10 && n < 1000);
    }
    free(v);
    sdm_mesh_dispose(&m);
}

static void test_invalid_arguments(void **state)
{
    (void)state;
    sdm_mesh m = {0}, empty = {0};
    make_box(&m);
    const sdm_grid g = make_grid(5);
    sdm_grid bad = g;
    bad.spacing[1] = 0;
    float v;
    sdm_error err = {0};
    assert_null(sdm_method_at(sdm_method_count()));
    assert_null(sdm_method_find("fast", &err));
    const sdm_error unknown = err;
    assert_int_equal(unknown.status, SDM_E_ARG);
    for (size_t k = 0; k < sdm_method_count(); k++) {
        const sdm_method *method = sdm_method_at(k);
        assert_ptr_equal(sdm_method_find(method->name, NULL), method);
        assert_non_null(strstr(unknown.text, method->name)); // the message lists all methods
        assert_true(*method->summary && *method->reference);
        assert_int_equal(method->map(NULL, &g, NULL, &v, NULL, &err), SDM_E_ARG);
        assert_int_equal(method->map(&m, NULL, NULL, &v, NULL, &err), SDM_E_ARG);
        assert_int_equal(method->map(&m, &g, NULL, NULL, NULL, &err), SDM_E_ARG);
        assert_int_equal(method->map(&m, &bad, NULL, &v, NULL, &err), SDM_E_ARG);
        assert_int_equal(method->map(&empty, &g, NULL, &v, NULL, &err), SDM_E_MESH);
        assert_int_equal(
            method->map(&m, &g, &(sdm_method_opts){.max_error_mm = -1}, &v, NULL, &err), SDM_E_ARG);
        assert_int_equal(
            method->map(&m, &g, &(sdm_method_opts){.max_error_mm = NAN}, &v, NULL, &err),
            SDM_E_ARG);
        assert_non_null(strstr(err.text, "max_error_mm"));
        assert_int_equal(method->map(&m, &g, NULL, &v, NULL, NULL),
                         SDM_OK); // the report and the error text are optional
    }
    assert_null(sdm_method_find(NULL, NULL));
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_error_bounds_against_brute_force),
        cmocka_unit_test(test_methods_agree_on_surface_and_sign),
        cmocka_unit_test(test_octree_keeps_error_bound),
        cmocka_unit_test(test_edt_bound_covers_missed_parts),
        cmocka_unit_test(test_threads_give_same_bits),
        cmocka_unit_test(test_cancellation_and_memory_limits),
        cmocka_unit_test(test_invalid_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
