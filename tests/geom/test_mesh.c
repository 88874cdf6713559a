/* Meshes: storage, and the audit (sdm_mesh_audit) of meshes with known properties.
 * Tests: mesh.c survey.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"

static const double zero[3] = {0, 0, 0}, one[3] = {1, 1, 1};

static sdm_audit audit_of(const sdm_mesh *m)
{
    sdm_audit a;
    sdm_error err = {0};
    if (sdm_mesh_audit(m, &a, &err)) fail_msg("%s", err.text);
    return a;
}

static void test_reserve_copy_and_dispose(void **state)
{
    (void)state;
    sdm_mesh m = {0}, copy = {0};
    sdm_error err = {0};
    mesh_box(&m, zero, one);
    assert_int_equal(sdm_mesh_reserve(&m, 20, 30, &err), SDM_OK);
    assert_int_equal(m.n_vert, 20);
    assert_int_equal(m.n_tri, 30);
    assert_true(m.vert[3 * 7] == 1 && m.vert[3 * 7 + 1] == 1);
    assert_true(m.vert[3 * 19] == 0 && m.tri[89] == 0);
    assert_int_equal(sdm_mesh_copy(&m, &copy, &err), SDM_OK);
    assert_memory_equal(m.vert, copy.vert, 60 * sizeof(double));
    assert_memory_equal(m.tri, copy.tri, 90 * sizeof(uint32_t));
    assert_int_equal(sdm_mesh_reserve(&m, 4, 2, &err), SDM_OK);
    assert_int_equal(m.n_tri, 2);
    assert_int_equal(sdm_mesh_reserve(&m, (size_t)1 << 40, 1, &err), SDM_E_MESH);
    assert_non_null(strstr(err.text, "1099511627776"));
    assert_int_equal(m.n_vert, 4);
    sdm_alloc_fail_after(1);
    assert_int_equal(sdm_mesh_reserve(&m, 1000, 1, &err), SDM_E_NOMEM);
    sdm_alloc_fail_after(0);
    assert_int_equal(m.n_vert, 4);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(NULL);
    sdm_mesh_dispose(&copy);
}

static void test_audit_of_box(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_box(&m, (const double[3]){-1, 2, 3}, (const double[3]){1, 5, 7});
    const sdm_audit a = audit_of(&m);
    assert_true(a.closed && a.manifold && !a.inverted);
    assert_int_equal(a.n_vert, 8);
    assert_int_equal(a.n_tri, 12);
    assert_int_equal(a.components, 1);
    assert_int_equal(a.degenerate + a.duplicate + a.boundary_edges + a.nonmanifold_edges +
                         a.misoriented_edges + a.self_intersections,
                     0);
    assert_true(fabs(a.volume - 24) < 1e-12 && fabs(a.area - 52) < 1e-12);
    assert_true(a.min[0] == -1 && a.min[2] == 3 && a.max[1] == 5 && a.max[2] == 7);
    mesh_flip(&m);
    const sdm_audit b = audit_of(&m);
    assert_true(b.closed && b.inverted && fabs(b.volume + 24) < 1e-12);
    sdm_mesh_dispose(&m);
}

static void test_audit_counts_flaws(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_box(&m, zero, one);
    // a hole
    m.n_tri = 11;
    sdm_audit a = audit_of(&m);
    assert_true(!a.closed && !a.manifold);
    assert_int_equal(a.boundary_edges, 3);
    // one triangle with reversed orientation: along its three edges both triangles run in the same
    // direction
    m.n_tri = 12;
    mesh_triangle(&m, 0, m.tri[0], m.tri[2], m.tri[1]);
    a = audit_of(&m);
    assert_true(!a.closed);
    assert_int_equal(a.misoriented_edges, 3);
    // a duplicate of a triangle, and one of zero area
    mesh_box(&m, zero, one);
    mesh_make(&m, 8, 14);
    mesh_triangle(&m, 12, m.tri[1], m.tri[2], m.tri[0]);
    mesh_triangle(&m, 13, 0, 1, 1);
    a = audit_of(&m);
    assert_int_equal(a.duplicate, 1);
    assert_int_equal(a.degenerate, 1);
    assert_int_equal(a.nonmanifold_edges, 3);
    sdm_mesh_dispose(&m);
}

/* A triangle and its reverse enclose no volume. The computed volume is a rounding error of either
 * sign and must not make the audit report an inside-out mesh. */
static void test_rounded_zero_volume_is_not_inverted(void **state)
{
    (void)state;
    int negative = 0;
    for (uint64_t i = 0; i < 100; i++) {
        sdm_mesh m = {0};
        mesh_make(&m, 3, 2);
        for (size_t c = 0; c < 9; c++) m.vert[c] = sdm_rng_uniform(5, i, c);
        mesh_triangle(&m, 0, 0, 1, 2);
        mesh_triangle(&m, 1, 1, 0, 2);
        const sdm_audit a = audit_of(&m);
        assert_true(a.closed && !a.inverted);
        negative += a.volume < 0;
        sdm_mesh_dispose(&m);
    }
    assert_true(negative > 10);
}

static void test_equal_vertices_are_merged(void **state)
{
    (void)state;
    // the box with separate vertices for each triangle, as in an STL file; some zeros are -0.0
    sdm_mesh box = {0}, soup = {0};
    mesh_box(&box, zero, one);
    mesh_make(&soup, 36, 12);
    for (size_t i = 0; i < 36; i++) {
        const double *v = &box.vert[3 * box.tri[i]];
        mesh_vertex(&soup, i, v[0] == 0 && i % 2 ? -0.0 : v[0], v[1], v[2]);
        soup.tri[i] = (uint32_t)i;
    }
    const sdm_audit a = audit_of(&soup);
    assert_true(a.closed && a.manifold);
    assert_int_equal(a.components, 1);
    sdm_mesh_dispose(&box);
    sdm_mesh_dispose(&soup);
}

static void test_components_and_self_intersections(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, zero, 1, 8);
    mesh_sphere(&b, (const double[3]){3, 0, 0}, 1, 8);
    mesh_append(&m, &b);
    sdm_audit a = audit_of(&m);
    assert_int_equal(a.components, 2);
    assert_int_equal(a.self_intersections, 0);
    // two triangles that intersect; the same shifted far away (i = 1) and scaled down (i = 2)
    for (int i = 0; i < 3; i++) {
        const double scale = i == 2 ? 1e-9 : 1, at = i == 1 ? 1e6 : 0;
        mesh_make(&m, 6, 2);
        const double v[6][3] = {{0, 0, 0},      {2, 0, 0},     {0, 2, 0},
                                {0.5, 0.5, -1}, {0.5, 0.5, 1}, {3, 3, 0.25}};
        for (size_t k = 0; k < 6; k++)
            mesh_vertex(&m, k, v[k][0] * scale + at, v[k][1] * scale, v[k][2] * scale);
        mesh_triangle(&m, 0, 0, 1, 2);
        mesh_triangle(&m, 1, 3, 4, 5);
        a = audit_of(&m);
        assert_int_equal(a.self_intersections, 1);
        assert_false(a.closed);
    }
    // move the second triangle along x so that it no longer touches the first
    for (size_t k = 3; k < 6; k++) m.vert[3 * k] += 2.5e-9;
    assert_int_equal(audit_of(&m).self_intersections, 0);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

/* Does the segment from p to q pass through the triangle v? Valid for general position only. */
static bool segment_meets_triangle(const double p[3], const double q[3], const double v[3][3])
{
    double side[3], normal[3], h[2];
    for (int k = 0; k < 3; k++) {
        // signed volume of the tetrahedron of p, q and edge k: tells on which side of the edge the
        // line p q passes
        double a[3], b[3], c[3];
        for (int i = 0; i < 3; i++) {
            a[i] = q[i] - p[i];
            b[i] = v[k][i] - p[i];
            c[i] = v[(k + 1) % 3][i] - p[i];
        }
        side[k] = 0;
        for (int i = 0; i < 3; i++)
            side[k] += a[i] * (b[(i + 1) % 3] * c[(i + 2) % 3] - b[(i + 2) % 3] * c[(i + 1) % 3]);
    }
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        normal[i] =
            (v[1][j] - v[0][j]) * (v[2][k] - v[0][k]) - (v[1][k] - v[0][k]) * (v[2][j] - v[0][j]);
    }
    for (int e = 0; e < 2; e++) {
        h[e] = 0;
        for (int i = 0; i < 3; i++) h[e] += normal[i] * ((e ? q : p)[i] - v[0][i]);
    }
    return (side[0] > 0) == (side[1] > 0) && (side[0] > 0) == (side[2] > 0) &&
           (h[0] > 0) != (h[1] > 0);
}

static bool triangles_intersect(const double a[3][3], const double b[3][3])
{
    bool met = false;
    for (int k = 0; k < 3; k++)
        met = met || segment_meets_triangle(a[k], a[(k + 1) % 3], b) ||
              segment_meets_triangle(b[k], b[(k + 1) % 3], a);
    return met;
}

/* Random triangles with sizes in a ratio of up to 1 : 1000, some of which share a vertex. The
 * number of self-intersections must equal a brute-force count over all pairs. */
static void test_self_intersections_match_brute_force(void **state)
{
    (void)state;
    size_t total = 0;
    for (uint64_t round = 0; round < 30; round++) {
        const size_t n = 20 + 40 * (size_t)(round % 7);
        sdm_mesh m = {0};
        mesh_make(&m, 3 * n, n);
        for (size_t t = 0; t < n; t++) {
            const double size = 1.5 * pow(10, -3 * sdm_rng_uniform(5, round, 20 * t));
            for (size_t k = 0; k < 3; k++) {
                double x[3];
                for (size_t i = 0; i < 3; i++)
                    x[i] = 3 * sdm_rng_uniform(5, round, 20 * t + 1 + i) +
                           size * sdm_rng_uniform(5, round, 20 * t + 4 + 3 * k + i);
                mesh_vertex(&m, 3 * t + k, x[0], x[1], x[2]);
            }
            mesh_triangle(&m, t, 3 * t, 3 * t + 1, 3 * t + 2);
            // every third triangle shares its first vertex with an earlier one
            if (t % 3 == 2)
                m.tri[3 * t] =
                    m.tri[3 * (size_t)(sdm_rng_uniform(5, round, 20 * t + 15) * (double)t)];
        }
        size_t count = 0;
        for (size_t i = 0; i < n; i++) {
            for (size_t j = i + 1; j < n; j++) {
                double a[3][3], b[3][3];
                bool shared = false;
                for (size_t k = 0; k < 9; k++)
                    shared = shared || m.tri[3 * i + k / 3] == m.tri[3 * j + k % 3];
                for (size_t k = 0; k < 3; k++) {
                    memcpy(a[k], &m.vert[3 * m.tri[3 * i + k]], sizeof a[k]);
                    memcpy(b[k], &m.vert[3 * m.tri[3 * j + k]], sizeof b[k]);
                }
                count +=
                    !shared && triangles_intersect((const double(*)[3])a, (const double(*)[3])b);
            }
        }
        assert_int_equal(audit_of(&m).self_intersections, count);
        total += count;
        sdm_mesh_dispose(&m);
    }
    assert_true(total > 300);
}

/* Scaling a mesh by any accepted power of two keeps the counts and the inside-out flag, and scales
 * area and volume exactly. Sizes beyond the limits are refused. */
static void test_audit_scales_with_size(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, zero, 1, 6);
    mesh_sphere(&b, (const double[3]){0.7, 0.1, 0.2}, 1, 6);
    mesh_append(&m, &b);
    mesh_flip(&m);
    assert_int_equal(sdm_mesh_copy(&m, &b, NULL), SDM_OK);
    const sdm_audit one_mm = audit_of(&m);
    assert_true(one_mm.inverted && one_mm.self_intersections > 10);
    static const int sizes[] = {-231, -100, 100, 231};
    for (size_t k = 0; k < 4; k++) {
        for (size_t i = 0; i < 3 * m.n_vert; i++) b.vert[i] = ldexp(m.vert[i], sizes[k]);
        const sdm_audit a = audit_of(&b);
        assert_true(a.inverted && a.self_intersections == one_mm.self_intersections &&
                    a.degenerate == 0);
        assert_true(a.area == ldexp(one_mm.area, 2 * sizes[k]) &&
                    a.volume == ldexp(one_mm.volume, 3 * sizes[k]));
    }
    static const double refused[] = {1e-300, 1e-110, 1e-71, 1e71, 1e80, 1e100};
    for (size_t k = 0; k < 6; k++) {
        sdm_audit a;
        sdm_error err = {0};
        for (size_t i = 0; i < 3 * m.n_vert; i++) b.vert[i] = refused[k] * m.vert[i];
        assert_int_equal(sdm_mesh_audit(&b, &a, &err), SDM_E_MESH);
        assert_non_null(strstr(err.text, k < 3 ? "1e-70" : "1e70"));
    }
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

static void test_invalid_meshes_are_refused(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_audit a;
    sdm_error err = {0};
    assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_E_MESH);
    assert_non_null(strstr(err.text, "no triangle"));
    assert_int_equal(sdm_mesh_audit(NULL, &a, &err), SDM_E_ARG);
    mesh_box(&m, zero, one);
    m.tri[4] = 8;
    assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_E_MESH);
    assert_string_equal(err.text, "triangle 1 names vertex 8 of 8");
    m.tri[4] = 0;
    m.vert[3 * 5 + 1] = NAN;
    assert_int_equal(sdm_mesh_audit(&m, &a, &err), SDM_E_MESH);
    assert_non_null(strstr(err.text, "vertex 5 has the y coordinate"));
    sdm_mesh_dispose(&m);
}

static void test_failed_allocations(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, zero, 1, 6);
    mesh_sphere(&b, (const double[3]){1, 0, 0}, 1, 6);
    mesh_append(&m, &b);
    sdm_audit a;
    unsigned long n = 1;
    for (;; n++) {
        sdm_error err = {0};
        sdm_alloc_fail_after(n);
        const sdm_status s = sdm_mesh_audit(&m, &a, &err);
        sdm_alloc_fail_after(0);
        if (!s) break;
        assert_int_equal(s, SDM_E_NOMEM);
        assert_true(err.text[0] != 0);
    }
    assert_true(n > 2);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reserve_copy_and_dispose),
        cmocka_unit_test(test_audit_of_box),
        cmocka_unit_test(test_audit_counts_flaws),
        cmocka_unit_test(test_rounded_zero_volume_is_not_inverted),
        cmocka_unit_test(test_equal_vertices_are_merged),
        cmocka_unit_test(test_components_and_self_intersections),
        cmocka_unit_test(test_self_intersections_match_brute_force),
        cmocka_unit_test(test_audit_scales_with_size),
        cmocka_unit_test(test_invalid_meshes_are_refused),
        cmocka_unit_test(test_failed_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
