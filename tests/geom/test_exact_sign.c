/* Signs of the exact engine at single points: cavities, open, one-sided and inside-out meshes, the
 * three sign methods, exact predicates.
 * Tests: crossings.c parts.c predicates.c pseudonormal.c sign.c winding.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "exactly/predicates.h"
#include "oracle/exact_meshes.h"
#include "oracle/exact_tools.h"
#include "sdm/exact.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/rng.h"

static const double zero[3] = {0, 0, 0};

static double uniform(uint64_t stream, uint64_t i, double lo, double hi)
{
    return lo + (hi - lo) * sdm_rng_uniform(13, stream, i);
}

static double norm(const double x[3]) { return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]); }

static void test_orientation_predicate_is_exact(void **state)
{
    (void)state;
    // coordinates are integers, scaled by a power of two and far from the origin: the expected sign
    // is computed in integer arithmetic
    for (uint64_t i = 0; i < 20000; i++) {
        int64_t c[6];
        double p[3][2];
        for (uint64_t k = 0; k < 6; k++) {
            c[k] = (int64_t)sdm_rng_below(13, 1, 8 * i + k, 7) + (int64_t)1000000007;
            p[k / 2][k % 2] = (double)c[k] * 0x1p-20;
        }
        const int64_t det = (c[2] - c[0]) * (c[5] - c[1]) - (c[3] - c[1]) * (c[4] - c[0]);
        const int side = sdm_side(p[0], p[1], p[2], NULL);
        if (det) assert_int_equal(side, det > 0 ? 1 : -1);
        const bool same = c[0] == c[2] && c[1] == c[3];
        if (!same) assert_int_equal(side, -sdm_side(p[1], p[0], p[2], NULL));
    }
    // a line for which the determinant in floating point has the wrong sign
    const double u[2] = {0.5, 0.5}, v[2] = {12, 12}, near[2] = {0.5 + 0x1p-53, 0.5};
    assert_int_equal(sdm_side(u, v, near, NULL), -1);
    const double far[2] = {24, 24};
    assert_int_equal(sdm_side(u, v, far, NULL),
                     // collinear: the tie-break moves p by (e, e^2), e -> 0, which is to the right
                     // of the diagonal
                     -1);
}

// A ball within a ball, both oriented outwards: the inner surface bounds nothing in the union, and
// the pseudo-normal method refuses the mesh.
static void test_nested_ball_is_united(void **state)
{
    (void)state;
    sdm_mesh m = {0}, part = {0};
    mesh_sphere(&m, zero, 1, 24);
    mesh_sphere(&part, zero, 3, 24);
    mesh_append(&m, &part);
    sdm_exact *e = engine(&m, NULL);
    assert_true(sdm_exact_get_report(e)->unioned);
    assert_true(fabs(sdm_exact_point(e, zero, NULL, NULL, NULL) + 3) < 0.05);
    sdm_exact_free(e);
    sdm_error err;
    const sdm_exact_opts opts = {.sign = SDM_SIGN_PSEUDONORMAL};
    assert_int_equal(sdm_exact_create(&m, &opts, &e, &err), SDM_E_ARG);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&part);
}

// The same triangle 3000 times: the audit must fail with an error instead of using unbounded
// memory.
static void test_many_equal_triangles_are_refused(void **state)
{
    (void)state;
    enum { LAYERS = 3000 };
    sdm_mesh m = {0};
    sdm_audit a;
    sdm_error err;
    assert_int_equal(sdm_mesh_reserve(&m, 3, LAYERS, &err), SDM_OK);
    const double vert[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    for (int i = 0; i < 9; i++) m.vert[i] = vert[i];
    for (uint32_t i = 0; i < 3 * LAYERS; i++) m.tri[i] = i % 3;
    assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_E_MESH);
    sdm_mesh_dispose(&m);
}

static void test_ball_within_cavity(void **state)
{
    (void)state;
    // a ball with a cavity that contains a smaller ball
    sdm_mesh m = {0}, part = {0};
    mesh_sphere(&m, zero, 3, 24);
    mesh_sphere(&part, zero, 2, 24);
    mesh_flip(&part);
    mesh_append(&m, &part);
    mesh_sphere(&part, zero, 1, 24);
    mesh_append(&m, &part);
    for (int method = SDM_SIGN_AUTO; method <= SDM_SIGN_WINDING; method++) {
        sdm_exact *e = engine(&m, &(sdm_exact_opts){.sign = (sdm_sign_method)method});
        const sdm_exact_report *r = sdm_exact_get_report(e);
        assert_true(!r->unioned && !r->turned && r->audit.components == 3);
        assert_int_equal(r->sign, method ? method : SDM_SIGN_CROSSINGS);
        for (uint64_t i = 0; i < 2000; i++) {
            double x[3];
            for (uint64_t a = 0; a < 3; a++) x[a] = uniform(1, 3 * i + a, -3.5, 3.5);
            const double l = norm(x), d = sdm_exact_point(e, x, NULL, NULL, NULL);
            if (fabs(l - 1) < 0.02 || fabs(l - 2) < 0.03 || fabs(l - 3) < 0.04) continue;
            assert_true((d < 0) == (l < 1 || (l > 2 && l < 3)));
        }
        const sdm_grid g = sdm_grid_centred((const int64_t[3]){21, 22, 23}, 0.33, zero);
        float *v = malloc(sdm_grid_count(&g) * sizeof *v);
        assert_int_equal(sdm_exact_map(e, &g, v, NULL), SDM_OK);
        for (size_t i = 0; i < sdm_grid_count(&g); i++) {
            const double index[3] = {(double)(i % 21), (double)(i / 21 % 22),
                                     (double)(i / 21 / 22)};
            double x[3];
            sdm_grid_world(&g, index, x);
            const double d = sdm_exact_point(e, x, NULL, NULL, NULL);
            assert_true(fabs(v[i] - d) <= 1e-12 + 1e-7 * fabs(d));
        }
        free(v);
        sdm_exact_free(e);
    }
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&part);
}

static void test_inside_out_mesh_gives_same_map(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    const spiral s = SPIRAL_NOMINAL;
    mesh_spiral(&m, &s, 0.6);
    sdm_exact *right = engine(&m, NULL);
    mesh_flip(&m);
    sdm_exact *e = engine(&m, NULL);
    assert_true(sdm_exact_get_report(e)->turned && sdm_exact_get_report(e)->audit.inverted);
    assert_false(sdm_exact_get_report(right)->turned);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){24, 20, 12}, 0.5, (const double[3]){0, 0, 2});
    float *v = malloc(sdm_grid_count(&g) * sizeof *v), *w = malloc(sdm_grid_count(&g) * sizeof *w);
    assert_int_equal(sdm_exact_map(right, &g, v, NULL), SDM_OK);
    assert_int_equal(sdm_exact_map(e, &g, w, NULL), SDM_OK);
    for (size_t i = 0; i < sdm_grid_count(&g); i++)
        assert_true(fabs(v[i] - w[i]) <= 1e-11 + 1.2e-7 * fabs(v[i]));
    free(v);
    free(w);
    sdm_exact_free(right);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_open_cup_uses_winding_number(void **state)
{
    (void)state;
    // a sphere without its top; a point is inside if its winding number exceeds 1/2, that is, if
    // the opening covers a solid angle of less than 2 pi
    sdm_mesh m = {0};
    mesh_sphere(&m, zero, 1, 30);
    size_t kept = 0;
    for (size_t t = 0; t < m.n_tri; t++) {
        bool top = false;
        for (size_t k = 0; k < 3; k++) top = top || m.vert[3 * (size_t)m.tri[3 * t + k] + 2] > 0.61;
        if (!top) mesh_triangle(&m, kept++, m.tri[3 * t], m.tri[3 * t + 1], m.tri[3 * t + 2]);
    }
    m.n_tri = kept;
    sdm_exact *e = engine(&m, NULL);
    assert_int_equal(sdm_exact_get_report(e)->sign, SDM_SIGN_WINDING);
    assert_true(!sdm_exact_get_report(e)->unioned &&
                sdm_exact_get_report(e)->audit.boundary_edges == 60);
    assert_true(sdm_exact_point(e, (const double[3]){0, 0, -0.5}, NULL, NULL, NULL) < -0.49);
    assert_true(sdm_exact_point(e, (const double[3]){0, 0, 0.3}, NULL, NULL, NULL) < 0);
    assert_true(sdm_exact_point(e, (const double[3]){0, 0, 0.9}, NULL, NULL, NULL) > 0);
    for (uint64_t i = 0; i < 1500; i++) {
        double x[3];
        for (uint64_t a = 0; a < 3; a++) x[a] = uniform(2, 3 * i + a, -1.5, 1.5);
        const double d = sdm_exact_point(e, x, NULL, NULL, NULL), b = sdm_naive_point(&m, x);
        assert_true(fabs(d - b) < 1e-12);
    }
    // the same for a map, with the default number of threads
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){13, 14, 15}, 0.2, zero);
    float v[13 * 14 * 15], w[13 * 14 * 15];
    assert_int_equal(sdm_exact_map(e, &g, v, NULL), SDM_OK);
    assert_int_equal(sdm_naive_map(&m, &g, 1, w, NULL), SDM_OK);
    for (int i = 0; i < 13 * 14 * 15; i++) assert_true(fabsf(v[i] - w[i]) <= 2e-7f);
    sdm_exact_free(e);
    // methods that require a closed mesh return an error
    sdm_error err = {0};
    assert_int_equal(sdm_exact_create(&m, &(sdm_exact_opts){.sign = SDM_SIGN_CROSSINGS}, &e, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, "60 boundary edges"));
    assert_int_equal(
        sdm_exact_create(&m, &(sdm_exact_opts){.sign = SDM_SIGN_PSEUDONORMAL}, &e, &err),
        SDM_E_ARG);
    sdm_mesh_dispose(&m);
}

static void test_pseudonormal_refuses_overlap(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, zero, 1, 8);
    mesh_sphere(&b, (const double[3]){1, 0.1, 0.2}, 1, 8);
    mesh_append(&m, &b);
    sdm_exact *e = NULL;
    sdm_error err = {0};
    assert_int_equal(
        sdm_exact_create(&m, &(sdm_exact_opts){.sign = SDM_SIGN_PSEUDONORMAL}, &e, &err),
        SDM_E_ARG);
    assert_non_null(strstr(err.text, "intersecting pairs"));
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

/* A prism with a T-junction: vertex 6 lies in the middle of an edge of which only one side is split
 * there; a triangle of zero area fills the slit. */
static void test_pseudonormal_refuses_degenerate(void **state)
{
    (void)state;
    static const double vert[7][3] = {{0, 0, 0},     {0, 0, 2},     {1, 0, 0}, {1, 0, 2},
                                      {0.5, 0.9, 0}, {0.5, 0.9, 2}, {0, 0, 1}};
    static const uint8_t tri[10][3] = {{0, 2, 6}, {6, 2, 3}, {6, 3, 1}, {0, 1, 5}, {0, 5, 4},
                                       {2, 4, 5}, {2, 5, 3}, {0, 4, 2}, {1, 3, 5}, {0, 6, 1}};
    sdm_mesh m = {0};
    mesh_make(&m, 7, 10);
    for (size_t v = 0; v < 7; v++) mesh_vertex(&m, v, vert[v][0], vert[v][1], vert[v][2]);
    for (size_t t = 0; t < 10; t++) mesh_triangle(&m, t, tri[t][0], tri[t][1], tri[t][2]);
    sdm_exact *e = NULL;
    sdm_error err = {0};
    assert_int_equal(
        sdm_exact_create(&m, &(sdm_exact_opts){.sign = SDM_SIGN_PSEUDONORMAL}, &e, &err),
        SDM_E_ARG);
    assert_non_null(strstr(err.text, " 1 triangles without area"));
    // the automatic choice takes crossings instead
    e = engine(&m, NULL);
    assert_true(sdm_exact_get_report(e)->audit.manifold &&
                sdm_exact_get_report(e)->sign == SDM_SIGN_CROSSINGS);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_moebius_strip_has_right_distances(void **state)
{
    (void)state;
    // A Moebius strip has one side and thus no inside; the unsigned distance must still be right.
    const size_t n = 40;
    sdm_mesh m = {0};
    mesh_make(&m, 2 * n, 2 * n);
    for (size_t i = 0; i < n; i++) {
        const double a = 2 * 3.14159265358979 * (double)i / (double)n;
        for (size_t s = 0; s < 2; s++) {
            const double w = s ? 0.3 : -0.3;
            mesh_vertex(&m, 2 * i + s, (1 + w * cos(a / 2)) * cos(a), (1 + w * cos(a / 2)) * sin(a),
                        w * sin(a / 2));
        }
        const size_t p = 2 * i, last = i + 1 == n, q = last ? 1 : p + 2, r = last ? 0 : p + 3;
        mesh_triangle(&m, 2 * i, p, q, p + 1);
        mesh_triangle(&m, 2 * i + 1, q, r, p + 1);
    }
    sdm_exact *e = engine(&m, NULL);
    assert_int_equal(sdm_exact_get_report(e)->sign, SDM_SIGN_WINDING);
    assert_true(sdm_exact_get_report(e)->audit.misoriented_edges +
                    sdm_exact_get_report(e)->audit.boundary_edges >=
                2 * n);
    for (uint64_t i = 0; i < 1000; i++) {
        double x[3];
        for (uint64_t a = 0; a < 3; a++) x[a] = uniform(3, 3 * i + a, -1.5, 1.5);
        const double d = sdm_exact_point(e, x, NULL, NULL, NULL);
        assert_true(fabs(fabs(d) - fabs(sdm_naive_point(&m, x))) < 1e-13);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_opposite_sheets_enclose_nothing(void **state)
{
    (void)state;
    // a triangle and its reverse enclose nothing: the distance is positive everywhere
    sdm_mesh m = {0};
    mesh_make(&m, 3, 2);
    mesh_vertex(&m, 0, 0, 0, 0);
    mesh_vertex(&m, 1, 1, 0, 0);
    mesh_vertex(&m, 2, 0, 1, 0);
    mesh_triangle(&m, 0, 0, 1, 2);
    mesh_triangle(&m, 1, 0, 2, 1);
    sdm_exact *e = engine(&m, NULL);
    assert_int_equal(sdm_exact_get_report(e)->audit.duplicate, 1);
    assert_true(fabs(sdm_exact_point(e, (const double[3]){0.2, 0.2, -0.5}, NULL, NULL, NULL) -
                     0.5) < 1e-15);
    assert_true(isnan(sdm_exact_distance(e, (const double[3]){0, NAN, 0})));
    assert_true(fabs(sdm_exact_point(e, (const double[3]){0.2, 0.2, 0.5}, NULL, NULL, NULL) - 0.5) <
                1e-15);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

/* All three sign methods agree on a manifold mesh with sharp spikes and dents. */
static void test_sign_methods_agree(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, zero, 1, 9);
    for (size_t v = 0; v < m.n_vert; v++) {
        const double r = v % 3 == 0 ? 1.6 : v % 3 == 1 ? 0.5 : 0.9;
        for (int a = 0; a < 3; a++) m.vert[3 * v + (size_t)a] *= r;
    }
    sdm_exact *e[3];
    for (int i = 0; i < 3; i++)
        e[i] = engine(&m, &(sdm_exact_opts){.sign = (sdm_sign_method)(i + 1)});
    for (uint64_t i = 0; i < 5000; i++) {
        double x[3], d[3];
        for (uint64_t a = 0; a < 3; a++) x[a] = uniform(4, 3 * i + a, -1.7, 1.7);
        for (int k = 0; k < 3; k++) d[k] = sdm_exact_point(e[k], x, NULL, NULL, NULL);
        assert_true(d[0] == d[1] && d[1] == d[2]);
    }
    for (int i = 0; i < 3; i++) sdm_exact_free(e[i]);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orientation_predicate_is_exact),
        cmocka_unit_test(test_nested_ball_is_united),
        cmocka_unit_test(test_many_equal_triangles_are_refused),
        cmocka_unit_test(test_ball_within_cavity),
        cmocka_unit_test(test_inside_out_mesh_gives_same_map),
        cmocka_unit_test(test_open_cup_uses_winding_number),
        cmocka_unit_test(test_pseudonormal_refuses_overlap),
        cmocka_unit_test(test_pseudonormal_refuses_degenerate),
        cmocka_unit_test(test_moebius_strip_has_right_distances),
        cmocka_unit_test(test_opposite_sheets_enclose_nothing),
        cmocka_unit_test(test_sign_methods_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
