/* The exact engine on inputs that are numerically difficult, compared with closed forms: all
 * regions of a triangle, ties between features, thin wedges, narrow gaps, rays through vertices and
 * edges, triangles of zero area.
 * Tests: exact.c nearest.c point_triangle.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <float.h>

#include "oracle/random_meshes.h"
#include "sdm/exact.h"

static const double zero[3] = {0, 0, 0}, one[3] = {1, 1, 1};

static sdm_exact *engine(const sdm_mesh *m)
{
    sdm_exact *e = NULL;
    sdm_error err = {0};
    if (sdm_exact_create(m, NULL, &e, &err)) fail_msg("%s", err.text);
    return e;
}

static double distance_at(const sdm_exact *e, double x, double y, double z)
{
    return sdm_exact_point(e, (const double[3]){x, y, z}, NULL, NULL, NULL);
}

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void mesh_single_triangle(sdm_mesh *m, const double v[3][3], size_t turn)
{
    mesh_make(m, 3, 1);
    for (size_t k = 0; k < 3; k++) mesh_vertex(m, k, v[k][0], v[k][1], v[k][2]);
    mesh_triangle(m, 0, turn % 3, (turn + 1 + turn / 3) % 3, (turn + 2 - turn / 3) % 3);
}

/* A point is constructed in each of the seven regions (Voronoi regions of the face, three edges and
 * three vertices) of a triangle as foot point + offset; its distance must be the length of the
 * offset. */
static void test_constructed_points_in_all_triangle_regions(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 300; round++) {
        dice d = {1, round, 0};
        double v[3][3], n[3];
        const bool whole = round % 2;
        for (int k = 0; k < 9; k++)
            v[k / 3][k % 3] = whole ? floor(roll(&d, -4, 5)) : roll(&d, -1, 1);
        sdm_mesh m = {0};
        mesh_single_triangle(&m, (const double(*)[3])v, round % 6);
        sdm_exact *e = engine(&m);
        double side[3][3];
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++) side[k][a] = v[(k + 1) % 3][a] - v[k][a];
        for (int a = 0; a < 3; a++)
            n[a] = side[0][(a + 1) % 3] * side[1][(a + 2) % 3] -
                   side[0][(a + 2) % 3] * side[1][(a + 1) % 3];
        if (!(dot3(n, n) > 1e-6)) {
            sdm_exact_free(e);
            sdm_mesh_dispose(&m);
            continue;
        }
        int made[3] = {0, 0, 0};
        for (int i = 0; i < 600; i++) {
            const int k = i % 3;
            const double s = roll(&d, 0, 1), t = roll(&d, 0, 1 - s),
                         up = pick(&d, 3) ? roll(&d, -2, 2) : 0;
            double from[3], way[3], out[3];
            // out: in the plane of the triangle, perpendicular to side k, pointing away from the
            // triangle
            for (int a = 0; a < 3; a++)
                out[a] =
                    side[k][(a + 1) % 3] * n[(a + 2) % 3] - side[k][(a + 2) % 3] * n[(a + 1) % 3];
            const int region = i / 3 % 3; // 0: face, 1: edge, 2: vertex
            const double far = roll(&d, 0, 1);
            for (int a = 0; a < 3; a++) {
                if (region == 0) {
                    from[a] = v[0][a] + s * side[0][a] - t * side[2][a];
                    way[a] = up * n[a];
                } else if (region == 1) {
                    from[a] = v[k][a] + s * side[k][a];
                    way[a] = up * n[a] + far * out[a];
                } else {
                    from[a] = v[k][a];
                    way[a] = whole ? floor(roll(&d, -3, 4)) : roll(&d, -1, 1);
                }
            }
            // keep only offsets within the vertex region: moving along either side increases the
            // distance
            if (region == 2 && (dot3(way, side[k]) > 0 || dot3(way, side[(k + 2) % 3]) < 0))
                continue;
            made[region]++;
            const double x[3] = {from[0] + way[0], from[1] + way[1], from[2] + way[2]},
                         truth = sqrt(dot3(way, way));
            const double unit = DBL_EPSILON * (8 + truth),
                         found = sdm_exact_point(e, x, NULL, NULL, NULL);
            if (!(fabs(fabs(found) - truth) <= 16 * unit))
                fail_msg("triangle %u, region %d: %.17g at (%.17g, %.17g, %.17g), need %.17g",
                         (unsigned)round, region, found, x[0], x[1], x[2], truth);
        }
        assert_true(made[0] && made[1]);
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

/* Unions of unit cubes of a lattice. The expected distance is computed from the full and the empty
 * lattice cells; all coordinates are exact in floating point. */
static void test_cube_lattice_matches_cell_distances(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 40; round++) {
        dice d = {2, round, 0}, again = d;
        sdm_mesh m = {0};
        random_cubes(&m, &d);
        bool full[5][5][5] = {{{false}}};
        for (int i = 0; i < 27; i++)
            full[1 + i / 9][1 + i / 3 % 3][1 + i % 3] = pick(&again, 5) < 2;
        full[2][2][2] = true;
        sdm_exact *e = engine(&m);
        sdm_grid g = sdm_grid_centred((const int64_t[3]){17, 17, 17}, 0.25,
                                      (const double[3]){1.5, 1.5, 1.5});
        static const int turn[3][3] = {{0, 1, 2}, {1, 2, 0}, {2, 1, 0}};
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) g.dir[3 * b + a] = turn[round % 3][a] == b ? 1 : 0;
        float v[17 * 17 * 17];
        assert_int_equal(sdm_exact_map(e, &g, v, NULL), SDM_OK);
        for (int i = 0; i < 17 * 17 * 17; i++) {
            const double index[3] = {i % 17, i / 17 % 17, i / 17 / 17};
            double x[3], to_full = INFINITY, to_empty = INFINITY;
            sdm_grid_world(&g, index, x);
            for (int c = 0; c < 125; c++) {
                double lo[3], hi[3];
                const int cell[3] = {c % 5, c / 5 % 5, c / 25};
                for (int a = 0; a < 3; a++) {
                    lo[a] = cell[a] - 1;
                    hi[a] = lo[a] + 1;
                }
                const double to = fmax(box_distance(x, lo, hi), 0);
                if (full[cell[2]][cell[1]][cell[0]])
                    to_full = fmin(to_full, to);
                else
                    to_empty = fmin(to_empty, to);
            }
            const double truth = to_full > 0 ? to_full : -to_empty;
            const double found = sdm_exact_point(e, x, NULL, NULL, NULL);
            if (!(fabs(found - truth) <= 4e-16 * (1 + fabs(truth))) ||
                !(fabs(v[i] - truth) <= 4e-16 + 6e-8 * fabs(truth)))
                fail_msg("cubes %u: point %.17g, voxel %.9g at (%g, %g, %g), need %.17g",
                         (unsigned)round, found, (double)v[i], x[0], x[1], x[2], truth);
        }
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

/* A unit cube with grid rows along its space diagonal: rows pass through two opposite vertices and
 * cross three edges at the same point. */
static void test_rows_through_vertices_and_edges(void **state)
{
    (void)state;
    const double third = sqrt(1.0 / 3), half = sqrt(0.5), sixth = sqrt(1.0 / 6);
    const double r[9] = {third, third, third, half, -half, 0, sixth, sixth, -2 * sixth};
    sdm_mesh m = {0}, turned = {0};
    mesh_box(&m, zero, one);
    mesh_box(&turned, zero, one);
    mesh_rotate(&turned, r);
    sdm_exact *straight = engine(&m), *tilted = engine(&turned);
    // `straight` is mapped on a tilted grid, `tilted` (the rotated cube) on an axis-aligned one; in
    // both cases the rows run along the cube's diagonal
    sdm_grid g = {.n = {25, 13, 13}, .spacing = {sqrt(3.0) / 8, sqrt(0.5) / 2, sqrt(1.0 / 6) / 2}};
    double index[3] = {-8, -6, -6}, first[3];
    for (int b = 0; b < 3; b++) index[b] *= g.spacing[b];
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) g.dir[3 * a + b] = r[3 * b + a];
    sdm_grid h = g;
    for (int a = 0; a < 3; a++) {
        first[a] = 0;
        for (int b = 0; b < 3; b++) {
            first[a] += g.dir[3 * a + b] * index[b];
            h.dir[3 * a + b] = a == b;
        }
        g.origin[a] = first[a];
        h.origin[a] = index[a];
    }
    static float v[25 * 13 * 13], w[25 * 13 * 13];
    assert_int_equal(sdm_exact_map(straight, &g, v, NULL), SDM_OK);
    assert_int_equal(sdm_exact_map(tilted, &h, w, NULL), SDM_OK);
    for (int i = 0; i < 25 * 13 * 13; i++) {
        const double at_index[3] = {i % 25, i / 25 % 13, i / 25 / 13};
        double x[3], y[3];
        sdm_grid_world(&g, at_index, x);
        sdm_grid_world(&h, at_index, y);
        const double truth = box_distance(x, zero, one), tolerance = 1e-14 + 6e-8 * fabs(truth);
        assert_true(fabs(v[i] - truth) <= tolerance);
        assert_true(fabs(w[i] - truth) <= tolerance);
        assert_true(fabs(sdm_exact_point(straight, x, NULL, NULL, NULL) - truth) <= 1e-14);
        assert_true(fabs(sdm_exact_point(tilted, y, NULL, NULL, NULL) - truth) <= 1e-14);
    }
    sdm_exact_free(straight);
    sdm_exact_free(tilted);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&turned);
}

/* Triangles of zero area (a point, or a segment with the third vertex at an end or in between) must
 * not change the inside/outside sign, even if rays run along them. */
static void test_zero_area_triangles_keep_the_sign(void **state)
{
    (void)state;
    const double corner[4][3] = {{1, 1, 1}, {-2, 1, 1}, {0.5, 0.5, 0.25}, {0.25, 1, 1}};
    static const size_t pick_of[5][3] = {{0, 0, 0}, {0, 1, 1}, {0, 3, 1}, {2, 2, 2}, {3, 3, 0}};
    for (int kind = 0; kind < 5; kind++) {
        for (int axis = 0; axis < 3; axis++) {
            sdm_mesh m = {0};
            mesh_box(&m, zero, one);
            mesh_make(&m, 11, 14);
            for (size_t k = 0; k < 3; k++) {
                const double *c = corner[pick_of[kind][k]];
                mesh_vertex(&m, 8 + k, c[(3 - axis) % 3], c[(4 - axis) % 3], c[(5 - axis) % 3]);
            }
            mesh_triangle(&m, 12, 8, 9, 10);
            mesh_triangle(&m, 13, 10, 9, 8); // the reversed copy closes the mesh again
            sdm_exact *e = engine(&m);
            assert_true(sdm_exact_get_report(e)->audit.closed &&
                        sdm_exact_get_report(e)->audit.degenerate == 2);
            const sdm_grid g =
                sdm_grid_centred((const int64_t[3]){17, 17, 17}, 0.25, (const double[3]){0, 0, 0});
            static float v[17 * 17 * 17];
            assert_int_equal(sdm_exact_map(e, &g, v, NULL), SDM_OK);
            for (int i = 0; i < 17 * 17 * 17; i++) {
                const double index[3] = {i % 17, i / 17 % 17, i / 17 / 17};
                double x[3];
                sdm_grid_world(&g, index, x);
                const double truth = box_distance(x, zero, one),
                             found = sdm_exact_point(e, x, NULL, NULL, NULL);
                // a triangle of zero area may count as surface (distance 0), but it must not
                // separate inside from outside
                if (fabs(truth) > 0 && fabs(found) > 1e-15 && (found < 0) != (truth < 0))
                    fail_msg("kind %d along %c: %g at (%g, %g, %g), need %g", kind, "xyz"[axis],
                             found, x[0], x[1], x[2], truth);
                if (fabs(truth) > 0 && fabs(found) > 1e-15 && (v[i] < 0) != (truth < 0))
                    fail_msg("kind %d along %c: voxel %g at (%g, %g, %g), need %g", kind,
                             "xyz"[axis], (double)v[i], x[0], x[1], x[2], truth);
                assert_true(fabs(fabs(v[i]) - fabs(found)) <= 1e-15 + 6e-8 * fabs(found));
            }
            sdm_exact_free(e);
            sdm_mesh_dispose(&m);
        }
    }
}

/* A wedge with a sharp edge at x = 0 and thickness t at x = 1: distances from both of its large
 * faces and from the sharp edge. */
static void test_thin_wedges(void **state)
{
    (void)state;
    static const uint8_t face[8][3] = {{0, 2, 1}, {3, 4, 5}, {0, 1, 4}, {0, 4, 3},
                                       {1, 2, 5}, {1, 5, 4}, {2, 0, 3}, {2, 3, 5}};
    for (int power = 1; power <= 12; power++) {
        const double t = pow(10, -power);
        sdm_mesh m = {0};
        mesh_make(&m, 6, 8);
        for (size_t i = 0; i < 2; i++) {
            mesh_vertex(&m, 3 * i, 0, 0, i ? 1 : 0);
            mesh_vertex(&m, 3 * i + 1, 1, 0, i ? 1 : 0);
            mesh_vertex(&m, 3 * i + 2, 1, t, i ? 1 : 0);
        }
        for (size_t k = 0; k < 8; k++) mesh_triangle(&m, k, face[k][0], face[k][1], face[k][2]);
        sdm_exact *e = engine(&m);
        const double slope = 1 / sqrt(1 + t * t);
        for (int i = 1; i < 16; i++) {
            const double x = i / 16.0, z = 0.5;
            assert_true(fabs(distance_at(e, x, -0.25, z) - 0.25) <= 1e-15);
            assert_true(fabs(distance_at(e, x, t * x + 0.01, z) - 0.01 * slope) <= 1e-15);
            // halfway between the two faces, then at similar distances outside of each face
            const double h = 0.5 * t * x;
            assert_true(fabs(distance_at(e, x, h, z) + fmin(h * slope, h)) <= 1e-15 || 1 - x < h);
            assert_true(fabs(distance_at(e, x, -h, z) - h) <= 1e-15);
            assert_true(fabs(distance_at(e, x, 3 * h, z) - h * slope) <= 1e-15);
        }
        assert_true(fabs(distance_at(e, -0.5, 0, 0.5) - 0.5) <= 1e-15);
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

/* Two unit cubes separated by a narrow gap: halfway across the gap the distance is half of the
 * gap's width. */
static void test_narrow_gaps(void **state)
{
    (void)state;
    for (int power = 0; power <= 12; power++) {
        const double gap = pow(10, -power), lo[3] = {1 + gap, 0, 0}, hi[3] = {2 + gap, 1, 1},
                     width = lo[0] - 1;
        sdm_mesh m = {0}, part = {0};
        mesh_box(&m, zero, one);
        mesh_box(&part, lo, hi);
        mesh_append(&m, &part);
        sdm_exact *e = engine(&m);
        assert_false(sdm_exact_get_report(e)->unioned);
        for (int i = 1; i < 8; i++) {
            const double y = i / 8.0, middle = 1 + width / 2;
            assert_true(fabs(distance_at(e, middle, y, 0.5) - width / 2) <= 4 * DBL_EPSILON);
            assert_true(distance_at(e, middle, y, 0.5) > 0);
            assert_true(fabs(distance_at(e, 1 - width / 4, y, 0.5) +
                             fmin(width / 4, fmin(y, 1 - y))) <= 4 * DBL_EPSILON);
            assert_true(distance_at(e, 1 - width / 4, y, 0.5) < 0 &&
                        distance_at(e, lo[0] + width / 4, y, 0.5) < 0);
        }
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
        sdm_mesh_dispose(&part);
    }
}

/* A random star buried in a box. At its vertices the winding number jumps from 1 to 2, but both
 * values mean inside: the distance is the negative distance to the box. */
static void test_vertices_of_buried_parts_are_inside(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 30; round++) {
        dice d = {3, round, 0};
        double r[9];
        rotation(&d, r);
        sdm_mesh m = {0}, part = {0};
        mesh_box(&m, (const double[3]){-2, -2, -2}, (const double[3]){2, 2, 2});
        random_star(&part, &d);
        mesh_rotate(&part, r);
        mesh_append(&m, &part);
        sdm_exact *e = engine(&m);
        assert_true(sdm_exact_get_report(e)->unioned && sdm_exact_get_report(e)->n_tri_used == 12);
        for (size_t t = 0; t < part.n_tri; t++) {
            double x[3] = {0, 0, 0};
            for (size_t k = 0; k < 3; k++) {
                const double *v = &part.vert[3 * (size_t)part.tri[3 * t + k]],
                             truth = box_distance(v, m.vert, m.vert + 21);
                if (!(fabs(sdm_exact_point(e, v, NULL, NULL, NULL) - truth) <= 1e-15))
                    fail_msg("star %u: %.17g on a corner at (%.17g, %.17g, %.17g), need %.17g",
                             (unsigned)round, sdm_exact_point(e, v, NULL, NULL, NULL), v[0], v[1],
                             v[2], truth);
                for (int a = 0; a < 3; a++) x[a] += v[a] * (k < 2 ? 0.5 : 0);
            }
            assert_true(fabs(sdm_exact_point(e, x, NULL, NULL, NULL) -
                             box_distance(x, m.vert, m.vert + 21)) <= 1e-15);
        }
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
        sdm_mesh_dispose(&part);
    }
}

/* A tilted plate that is about 40 rounding tolerances thick, with a long thin triangle in one face
 * or in both. Extrapolated beyond such a triangle, the rounding error of its plane exceeds the
 * thickness; the engine must still keep the two faces apart. */
static void test_thin_plates_keep_two_faces(void **state)
{
    (void)state;
    static const double thickness = 2e-10,
                        rim[4][2] = {{1000, 1120}, {1600, 1120}, {1600, 1160}, {1000, 1160}};
    static const double inner[2][3][2] = {{{1001, 1140}, {1599, 1140}, {1300, 1140.05}},
                                          {{1400, 1140}, {1450, 1140}, {1425, 1140.01}}};
    static const uint8_t face[10][3] = {{4, 5, 6}, {0, 1, 5}, {0, 5, 4}, {1, 2, 5}, {2, 6, 5},
                                        {2, 3, 6}, {3, 4, 6}, {3, 0, 4}, {0, 1, 2}, {0, 2, 3}};
    dice d = {1, 2, 0};
    double r[9];
    rotation(&d, r);
    for (int kind = 0; kind < 3; kind++) {
        sdm_mesh m = {0};
        mesh_make(&m, 14, 24);
        size_t n = 0;
        for (size_t side = 0; side < 2; side++) {
            const bool fine = kind == 2 || side == (size_t)kind;
            const double z = side ? thickness : 0;
            for (size_t k = 0; k < 7; k++) {
                const double *v = k < 4 ? rim[k] : inner[kind == 2 ? side : 0][k - 4];
                mesh_vertex(&m, 7 * side + k, v[0], v[1], z);
            }
            for (size_t k = fine ? 0 : 8; k < (fine ? 8 : 10); k++) {
                const uint8_t *f = face[k];
                mesh_triangle(&m, n++, 7 * side + f[side ? 0 : 1], 7 * side + f[side ? 1 : 0],
                              7 * side + f[2]);
            }
        }
        for (size_t k = 0; k < 4; k++) {
            const size_t l = (k + 1) % 4;
            mesh_triangle(&m, n++, k, l, 7 + l);
            mesh_triangle(&m, n++, k, 7 + l, 7 + k);
        }
        m.n_tri = n;
        mesh_rotate(&m, r);
        sdm_exact *e = engine(&m);
        assert_true(sdm_exact_get_report(e)->audit.manifold && !sdm_exact_get_report(e)->unioned);
        for (double x = 1001; x < 1600; x += 8) {
            for (double y = 1139.9; y < 1140.1; y += 0.003) {
                double above[3] = {x, y, 0.5}, below[3] = {x, y, -0.5};
                rotate(r, above, above);
                rotate(r, below, below);
                assert_true(fabs(sdm_exact_point(e, above, NULL, NULL, NULL) - (0.5 - thickness)) <=
                            1e-11);
                assert_true(fabs(sdm_exact_point(e, below, NULL, NULL, NULL) - 0.5) <= 1e-11);
            }
        }
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_constructed_points_in_all_triangle_regions),
        cmocka_unit_test(test_cube_lattice_matches_cell_distances),
        cmocka_unit_test(test_rows_through_vertices_and_edges),
        cmocka_unit_test(test_zero_area_triangles_keep_the_sign),
        cmocka_unit_test(test_thin_wedges),
        cmocka_unit_test(test_narrow_gaps),
        cmocka_unit_test(test_thin_plates_keep_two_faces),
        cmocka_unit_test(test_vertices_of_buried_parts_are_inside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
