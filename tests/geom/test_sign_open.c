/* Signs of whole maps of open meshes, voxel by voxel, compared with winding numbers from sums of
 * solid angles.
 * Tests: arena.c certify.c rows.c sign_rows.c winding.c */
#include "oracle/sign_check.h"
#include "sdm/internal/threads.h"

static bool within_two_caps(const double c[3]) { return c[0] > 0.7 || (c[1] < -0.5 && c[2] < 0.2); }
static bool at_positive_x(const double c[3]) { return c[0] > 0; }

static void mesh_moebius(sdm_mesh *m, size_t n)
{
    mesh_make(m, 2 * n, 2 * n);
    for (size_t i = 0; i < n; i++) {
        const double a = 2 * 3.14159265358979 * (double)i / (double)n;
        for (size_t s = 0; s < 2; s++) {
            const double w = s ? 0.3 : -0.3;
            mesh_vertex(m, 2 * i + s, (1 + w * cos(a / 2)) * cos(a), (1 + w * cos(a / 2)) * sin(a),
                        w * sin(a / 2));
        }
        const size_t p = 2 * i, last = i + 1 == n, q = last ? 1 : p + 2, r = last ? 0 : p + 3;
        mesh_triangle(m, 2 * i, p, q, p + 1);
        mesh_triangle(m, 2 * i + 1, q, r, p + 1);
    }
}

static void mesh_separate_triangles(sdm_mesh *m)
{
    sdm_mesh pieces = {0};
    mesh_make(&pieces, 3 * m->n_tri, m->n_tri);
    for (size_t t = 0; t < m->n_tri; t++) {
        for (size_t k = 0; k < 3; k++) {
            const double *x = &m->vert[3 * (size_t)m->tri[3 * t + k]];
            const double shrink = 1 - 0.02 * sdm_rng_uniform(29, 5, t);
            mesh_vertex(&pieces, 3 * t + k, shrink * x[0], shrink * x[1], shrink * x[2]);
        }
        mesh_triangle(&pieces, t, 3 * t, 3 * t + 1, 3 * t + 2);
    }
    sdm_mesh_dispose(m);
    *m = pieces;
}

enum { N_OPEN = 9 };

/* The open meshes: 0 and 1 spheres with holes, 2 half a sphere, 3 mixed orientation, 4 sphere with
 * a fin, 5 Moebius strip, 6 half of an overlapping tube, 7 flat sheet, 8 separate triangles. */
static void open_mesh(int which, sdm_mesh *m)
{
    mesh_sphere(m, zero, 1, which == 8 ? 6 : 16);
    switch (which) {
    case 0:
        drop_triangles(m, above);
        break;
    case 1:
        drop_triangles(m, within_two_caps);
        break;
    case 2:
        drop_triangles(m, at_positive_x);
        break;
    // every third triangle reversed: most edges are then run through twice in the same direction
    case 3:
        for (size_t t = 0; t < m->n_tri; t += 3)
            mesh_triangle(m, t, m->tri[3 * t], m->tri[3 * t + 2], m->tri[3 * t + 1]);
        break;
    case 4: { // a closed sphere with a fin: one edge has three triangles
        const size_t n = m->n_tri, v = m->n_vert;
        mesh_make(m, v + 1, n + 1);
        mesh_vertex(m, v, 0.3, 0.2, 1.8);
        mesh_triangle(m, n, m->tri[0], m->tri[1], v);
        break;
    }
    case 5:
        mesh_moebius(m, 24);
        break;
    case 6: {
        const spiral s = SPIRAL_NOMINAL;
        mesh_spiral(m, &s, 0.9);
        for (size_t i = 0; i < 3 * m->n_vert; i++) m->vert[i] *= 0.25;
        drop_triangles(m, at_positive_x);
        break;
    }
    case 7: // one quad: its winding number never exceeds 1/2
        mesh_make(m, 4, 2);
        for (size_t k = 0; k < 4; k++)
            mesh_vertex(m, k, k & 1 ? 0.8 : -0.9, k & 2 ? 0.7 : -0.8, 0.1);
        mesh_triangle(m, 0, 0, 1, 3);
        mesh_triangle(m, 1, 0, 3, 2);
        break;
    default: // a sphere of separate triangles that share no vertices
        mesh_separate_triangles(m);
        break;
    }
}

static void check_signs(const sdm_mesh *m, const sdm_grid *g, const char *name)
{
    sdm_exact *e = engine(m, SDM_SIGN_AUTO, 1), *threads = engine(m, SDM_SIGN_AUTO, 3);
    assert_int_equal(sdm_exact_get_report(e)->sign, SDM_SIGN_WINDING);
    float *v = map(e, g), *w = map(threads, g);
    const size_t n = sdm_grid_count(g);
    assert_memory_equal(v, w, n * sizeof *v);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        voxel(g, i, x);
        const double number = winding(m, x);
        if (fabs(number - 0.5) < 1e-9 || fabs((double)v[i]) < 1e-12) continue;
        if ((v[i] < 0) != (number > 0.5))
            fail_msg("%s: voxel %zu: %g, winding number %.12g", name, i, v[i], number);
        if (i % 7 == 0)
            assert_true((sdm_exact_point(e, x, NULL, NULL, NULL) < 0) == (number > 0.5));
    }
    sdm_sign_certificate c;
    sdm_error err = {0};
    assert_int_equal(sdm_exact_certify(e, g, v, &c, &err), SDM_OK);
    if (c.wrong)
        fail_msg("%s: %zu wrong, the first %d %d %d", name, c.wrong, (int)c.first_wrong[0],
                 (int)c.first_wrong[1], (int)c.first_wrong[2]);
    assert_true(c.checked > 0 && c.checked <= n && c.voxels == n && c.method == SDM_SIGN_WINDING);
    free(v);
    free(w);
    sdm_exact_free(e);
    sdm_exact_free(threads);
}

static void test_signs_match_winding_numbers(void **state)
{
    (void)state;
    for (int which = 0; which < N_OPEN; which++) {
        sdm_mesh m = {0};
        open_mesh(which, &m);
        char name[40];
        for (uint64_t seed = 0; seed < 3; seed++) {
            // seed 0: axis-aligned, with voxels in the planes of many vertices; seeds 1 and 2:
            // rotated and anisotropic, 2 also mirrored
            sdm_grid g = sdm_grid_centred((const int64_t[3]){23, 21, 25}, 0.125, zero);
            if (seed) {
                rotation(100 + seed, seed == 2, g.dir);
                g.spacing[1] = 0.17;
                for (int a = 0; a < 3; a++) {
                    g.origin[a] = 0.01 * a;
                    for (int c = 0; c < 3; c++)
                        g.origin[a] -= 0.5 * g.dir[3 * a + c] * g.spacing[c] * (double)(g.n[c] - 1);
                }
            }
            snprintf(name, sizeof name, "mesh %d, grid %d", which, (int)seed);
            check_signs(&m, &g, name);
        }
        sdm_mesh_dispose(&m);
    }
}

// The grid covers only a small part of the mesh: crossings and boundary edges lie in front of,
// within and behind the rows.
static void test_grid_covers_part_of_mesh(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    open_mesh(1, &m);
    for (uint64_t i = 0; i < 12; i++) {
        const double centre[3] = {uniform(2, 3 * i, -1, 1), uniform(2, 3 * i + 1, -1, 1),
                                  uniform(2, 3 * i + 2, -1, 1)};
        const sdm_grid g =
            sdm_grid_centred((const int64_t[3]){9, 40, 3 + (int64_t)i}, 0.02, centre);
        check_signs(&m, &g, "part");
    }
    sdm_mesh_dispose(&m);
}

static bool cancel_after_calls(void *user) { return ++*(int *)user >= 0; }

static void test_signs_can_be_cancelled(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    open_mesh(0, &m);
    sdm_exact *e = NULL;
    int calls = -1000000; // counts up to 0, then requests a stop
    const sdm_exact_opts o = {.n_threads = 1, .cancelled = cancel_after_calls, .user = &calls};
    sdm_error err = {0};
    assert_int_equal(sdm_exact_create(&m, &o, &e, &err), SDM_OK);
    calls = -1;
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){8, 40, 40}, 0.05, zero);
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    assert_int_equal(sdm_exact_sign(e, &g, v, &err), SDM_E_CANCELLED);
    assert_int_equal(calls, 0);
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

// Rows longer than one tile of the sign computation: along x, and along y for the certificate.
static void test_long_rows(void **state)
{
    (void)state;
    for (int which = 0; which < 2 * N_OPEN; which++) {
        const int axis = which % 2;
        sdm_mesh m = {0};
        open_mesh(which / 2, &m);
        int64_t n[3] = {1, 1, 2};
        n[axis] = 1200;
        sdm_grid g = sdm_grid_centred(n, 0.5, (const double[3]){0.1, 0.2, 0.3});
        g.spacing[axis] = 0.004;
        g.origin[axis] = -2.4;
        check_signs(&m, &g, "long rows");
        sdm_mesh_dispose(&m);
    }
}

// The scratch memory of all threads counts towards memory_limit.
static void test_memory_limit_includes_thread_scratch(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    open_mesh(0, &m);
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){5000, 1, 1}, 0.001, zero);
    float v[5000];
    for (int i = 0; i < 5000; i++) v[i] = 1;
    for (int n_threads = 1; n_threads <= 32 && sdm_threads(32) == 32; n_threads += 31) {
        const sdm_exact_opts o = {.n_threads = n_threads, .memory_limit = (size_t)16 << 20};
        sdm_exact *e = NULL;
        sdm_error err = {0};
        assert_int_equal(sdm_exact_create(&m, &o, &e, &err), SDM_OK);
        assert_int_equal(sdm_exact_sign(e, &g, v, &err), n_threads == 1 ? SDM_OK : SDM_E_NOMEM);
        if (n_threads > 1) assert_non_null(strstr(err.text, "33554432 bytes in 32 threads"));
        sdm_exact_free(e);
    }
    sdm_mesh_dispose(&m);
}

/* A mesh whose boundary is so long that the certificate falls back to sums of solid angles over all
 * triangles. */
static void test_certificate_by_solid_angle_sums(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, zero, 1, 20);
    mesh_separate_triangles(&m);
    int calls = -1000000;
    const sdm_exact_opts o = {.n_threads = 1, .cancelled = cancel_after_calls, .user = &calls};
    sdm_exact *e = NULL;
    sdm_error err = {0};
    sdm_sign_certificate c;
    assert_int_equal(sdm_exact_create(&m, &o, &e, &err), SDM_OK);
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){3, 4, 5}, 0.5, zero);
    float *v = map(e, &g);
    for (int bad = 0; bad < 2; bad++) {
        assert_int_equal(sdm_exact_certify(e, &g, v, &c, &err), SDM_OK);
        assert_string_equal(c.compared, "sums of solid angles");
        assert_true(c.checked == 60 && c.wrong == (size_t)bad &&
                    c.first_wrong[2] == (bad ? 0 : -1));
        v[0] = NAN;
    }
    calls = -1;
    assert_int_equal(sdm_exact_certify(e, &g, v, &c, &err), SDM_E_CANCELLED);
    assert_int_equal(calls, 0);
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_signs_match_winding_numbers),
        cmocka_unit_test(test_grid_covers_part_of_mesh),
        cmocka_unit_test(test_signs_can_be_cancelled),
        cmocka_unit_test(test_long_rows),
        cmocka_unit_test(test_memory_limit_includes_thread_scratch),
        cmocka_unit_test(test_certificate_by_solid_angle_sums),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
