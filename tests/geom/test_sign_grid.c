/* Signs of whole maps of closed meshes: grid rows that lie within faces, inside-out parts, scaled
 * and shifted inputs, and the certificate of signs.
 * Tests: certify.c row_base.c rows.c sign_rows.c */
#include "oracle/sign_check.h"

/* Bound on the signed distance to a prism, which is the half of the box abs(x) <= 4, abs(y) <= 3,
 * abs(z) <= 5 on the negative side of its diagonal plane. Its sign is exact: > 0 outside. */
static double prism_distance_bound(const double x[3])
{
    const double diagonal = (x[0] / 4 + x[2] / 5) / sqrt(1.0 / 16 + 1.0 / 25);
    return fmax(fmax(fabs(x[1]) - 3, diagonal), fmax(-4 - x[0], -5 - x[2]));
}

static void mesh_prism(sdm_mesh *m)
{
    static const uint8_t tri[8][3] = {{0, 1, 2}, {3, 5, 4}, {0, 3, 4}, {0, 4, 1},
                                      {1, 4, 5}, {1, 5, 2}, {2, 5, 3}, {2, 3, 0}};
    mesh_make(m, 6, 8);
    for (size_t v = 0; v < 6; v++)
        mesh_vertex(m, v, v % 3 == 1 ? 4 : -4, v < 3 ? -3 : 3, v % 3 == 2 ? 5 : -5);
    for (size_t t = 0; t < 8; t++) mesh_triangle(m, t, tri[t][0], tri[t][1], tri[t][2]);
}

/* A rotated prism whose faces lie exactly in rows of the equally rotated grid. Rounding moves the
 * vertices to either side of a row, so that a row crosses a face along its whole length or not at
 * all. */
static void test_rows_within_faces_have_right_signs(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 80; seed++) {
        double r[9];
        rotation(seed, seed % 2, r);
        sdm_grid g = {.n = {15, 13, 16}, .spacing = {1, 1, 1}};
        const double first[3] = {-7, -6, -7};
        memcpy(g.dir, r, sizeof r);
        sdm_mesh m = {0};
        mesh_prism(&m);
        for (size_t v = 0; v < m.n_vert; v++) {
            const double *p = &m.vert[3 * v];
            const double y[3] = {p[0], 0.8 * p[1] + 0.6 * p[2], 0.8 * p[2] - 0.6 * p[1]};
            double x[3];
            for (size_t a = 0; a < 3; a++)
                x[a] = r[3 * a] * y[0] + r[3 * a + 1] * y[1] + r[3 * a + 2] * y[2];
            memcpy(&m.vert[3 * v], x, sizeof x);
        }
        for (size_t a = 0; a < 3; a++)
            g.origin[a] = r[3 * a] * first[0] + r[3 * a + 1] * first[1] + r[3 * a + 2] * first[2];
        if (seed % 2) mesh_flip(&m);
        for (int sign = SDM_SIGN_CROSSINGS; sign <= SDM_SIGN_WINDING; sign += 2) {
            sdm_exact *e = engine(&m, (sdm_sign_method)sign, 1);
            assert_true(!sdm_exact_get_report(e)->turned);
            float *v = map(e, &g);
            for (size_t i = 0; i < sdm_grid_count(&g); i++) {
                double x[3], y[3];
                voxel(&g, i, x);
                for (size_t a = 0; a < 3; a++)
                    y[a] = r[a] * x[0] + r[3 + a] * x[1] + r[6 + a] * x[2];
                // undo the rotation about x: two faces are oblique to the rows, 4 y - 3 z = +-15
                const double p[3] = {y[0], 0.8 * y[1] - 0.6 * y[2], 0.6 * y[1] + 0.8 * y[2]};
                const double out = prism_distance_bound(p);
                if (fabs(out) < 1e-12) continue;
                if ((out < 0) != (v[i] < 0))
                    fail_msg("seed %d: voxel %zu at %g %g %g: %g", (int)seed, i, y[0], y[1], y[2],
                             v[i]);
                assert_true((sdm_exact_point(e, x, NULL, NULL, NULL) < 0) == (out < 0));
            }
            free(v);
            sdm_exact_free(e);
        }
        sdm_mesh_dispose(&m);
    }
}

static void test_certificate_counts_wrong_signs(void **state)
{
    (void)state;
    sdm_mesh m = {0}, cavity = {0};
    mesh_sphere(&m, zero, 1, 12);
    mesh_sphere(&cavity, zero, 0.5, 9);
    mesh_flip(&cavity);
    mesh_append(&m, &cavity);
    // 21 voxels along x: the last byte of a row in the bit array of compared signs is only partly
    // used
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){21, 18, 19}, 0.13, zero);
    const size_t n = sdm_grid_count(&g);
    static const char *const compared[] = {"crossings along y and z", "crossings along x, y and z",
                                           "crossings along y and z"};
    for (int sign = SDM_SIGN_CROSSINGS; sign <= SDM_SIGN_WINDING; sign++) {
        sdm_exact *e = engine(&m, (sdm_sign_method)sign, 2);
        float *v = map(e, &g);
        sdm_sign_certificate c;
        sdm_error err = {0};
        assert_int_equal(sdm_exact_certify(e, &g, v, &c, &err), SDM_OK);
        assert_string_equal(c.compared, compared[sign - 1]);
        assert_true(c.voxels == n && c.checked == n && c.wrong == 0 && c.below_zero == 0 &&
                    c.first_wrong[0] == -1);
        const size_t places[] = {n - 1, 20 + 21 * (17 + 18 * 3), 5 + 21 * (4 + 18 * 7)};
        for (size_t k = 0; k < 3; k++) {
            v[places[k]] = -v[places[k]];
            assert_int_equal(sdm_exact_certify(e, &g, v, &c, &err), SDM_OK);
            assert_int_equal(c.wrong, k + 1);
        }
        assert_true(c.first_wrong[0] == 20 && c.first_wrong[1] == 17 && c.first_wrong[2] == 3);
        for (size_t k = 0; k < 3; k++) v[places[k]] = -v[places[k]];
        // replace values by NaN: outside of the ball, within the solid, within the cavity
        const size_t nan_places[] = {5 + 21 * (4 + 18), 16 + 21 * (8 + 18 * 9),
                                     10 + 21 * (8 + 18 * 9)};
        for (size_t k = 0; k < 3; k++) {
            assert_true((v[nan_places[k]] < 0) == (k == 1));
            v[nan_places[k]] = NAN;
            assert_int_equal(sdm_exact_certify(e, &g, v, &c, &err), SDM_OK);
            assert_true(c.wrong == k + 1 && c.below_zero == 0);
        }
        assert_true(c.first_wrong[0] == 5 && c.first_wrong[1] == 4 && c.first_wrong[2] == 1);
        assert_int_equal(sdm_exact_certify(NULL, &g, v, &c, &err), SDM_E_ARG);
        assert_int_equal(sdm_exact_certify(e, NULL, v, &c, &err), SDM_E_ARG);
        assert_int_equal(sdm_exact_certify(e, &g, NULL, &c, &err), SDM_E_ARG);
        assert_int_equal(sdm_exact_certify(e, &g, v, NULL, &err), SDM_E_ARG);
        free(v);
        sdm_exact_free(e);
    }
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&cavity);
}

static void test_signs_are_applied_to_given_distances(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, zero, 1, 12);
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){11, 12, 13}, 0.2, zero);
    sdm_exact *e = engine(&m, SDM_SIGN_AUTO, 1);
    float *v = map(e, &g), ones[11 * 12 * 13];
    sdm_error err = {0};
    for (size_t i = 0; i < sdm_grid_count(&g); i++) ones[i] = 1;
    assert_int_equal(sdm_exact_sign(e, &g, ones, &err), SDM_OK);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) assert_true(ones[i] == (v[i] < 0 ? -1 : 1));
    assert_int_equal(sdm_exact_sign(e, &g, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_sign(e, NULL, ones, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_sign(NULL, &g, ones, &err), SDM_E_ARG);
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

/* Scales and shifts the mesh and the grid: the signs must stay the same, except at voxels within
 * rounding of the surface. */
static void check_signs_after_motion(const sdm_mesh *m, const sdm_grid *g, const float *v,
                                     double factor, const double shift[3])
{
    sdm_mesh b = {0};
    assert_int_equal(sdm_mesh_copy(m, &b, NULL), SDM_OK);
    for (size_t i = 0; i < 3 * b.n_vert; i++) b.vert[i] = factor * b.vert[i] + shift[i % 3];
    sdm_grid h = *g;
    for (int a = 0; a < 3; a++) {
        h.origin[a] = factor * h.origin[a] + shift[a];
        h.spacing[a] *= factor;
    }
    sdm_exact *e = engine(&b, SDM_SIGN_AUTO, 1);
    float *w = map(e, &h);
    const double largest = fabs(shift[0]) + fabs(shift[1]) + fabs(shift[2]) + 10 * factor;
    for (size_t i = 0; i < sdm_grid_count(g); i++) {
        if (fabs((double)w[i]) < 1e-15 * largest) continue;
        if ((v[i] < 0) != (w[i] < 0))
            fail_msg("factor %g, shift %g: voxel %zu: %g, %g", factor, shift[0], i, v[i], w[i]);
    }
    free(w);
    sdm_exact_free(e);
    sdm_mesh_dispose(&b);
}

static void test_scaling_and_shifting_keep_signs(void **state)
{
    (void)state;
    static const double factors[] = {0x1p-30, 0x1p30, 1e-9, 1e-3, 1e9, 3e-5};
    for (int open = 0; open < 2; open++) {
        sdm_mesh m = {0};
        mesh_sphere(&m, (const double[3]){0.01, 0.02, 0.03}, 1, 14);
        if (open) drop_triangles(&m, above);
        const sdm_grid g = sdm_grid_centred((const int64_t[3]){20, 21, 22}, 0.127, zero);
        sdm_exact *e = engine(&m, SDM_SIGN_AUTO, 1);
        float *v = map(e, &g);
        for (size_t i = 0; i < sizeof factors / sizeof *factors; i++)
            check_signs_after_motion(&m, &g, v, factors[i], zero);
        check_signs_after_motion(&m, &g, v, 1, (const double[3]){1e6, -3e6, 2e6});
        check_signs_after_motion(&m, &g, v, 1e-9, (const double[3]){1e-3, 1e-3, -1e-3});
        free(v);
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

/* Meshes that contain every face twice: with equal orientation the winding number is 2 inside and
 * the map stays the same; with opposite orientation the copies cancel and nothing is inside (see
 * exact.h). */
static void test_duplicated_faces(void **state)
{
    (void)state;
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){17, 17, 17}, 0.19, (const double[3]){0.4, 0.01, 0.02});
    sdm_mesh m = {0}, part = {0};
    // every face twice, equal orientation: the winding number is 2 inside
    mesh_sphere(&m, zero, 1, 10);
    sdm_exact *once = engine(&m, SDM_SIGN_AUTO, 1);
    float *v = map(once, &g), *w;
    mesh_sphere(&part, zero, 1, 10);
    mesh_append(&m, &part);
    sdm_exact *e = engine(&m, SDM_SIGN_AUTO, 1);
    assert_int_equal(sdm_exact_get_report(e)->sign, SDM_SIGN_CROSSINGS);
    w = map(e, &g);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) assert_true(fabsf(v[i] - w[i]) < 1e-6f);
    free(w);
    sdm_exact_free(e);
    // every face twice, opposite orientation: nothing is inside, but the unsigned distances stay
    // the same
    mesh_sphere(&m, zero, 1, 10);
    mesh_flip(&part);
    mesh_append(&m, &part);
    e = engine(&m, SDM_SIGN_AUTO, 1);
    w = map(e, &g);
    for (size_t i = 0; i < sdm_grid_count(&g); i++)
        assert_true(w[i] >= 0 && fabsf(fabsf(v[i]) - w[i]) < 1e-6f);
    free(w);
    free(v);
    sdm_exact_free(e);
    sdm_exact_free(once);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&part);
}

static void append_ball(sdm_mesh *m, double x, double radius, bool flipped)
{
    sdm_mesh ball = {0};
    mesh_sphere(&ball, (const double[3]){x, 0, 0}, radius, 12);
    if (flipped) mesh_flip(&ball);
    mesh_append(m, &ball);
    sdm_mesh_dispose(&ball);
}

static double distance_on_x_axis(const sdm_exact *e, double x)
{
    return sdm_exact_point(e, (const double[3]){x, 0.01, 0}, NULL, NULL, NULL);
}

static void test_inside_out_parts_are_reversed_or_subtracted(void **state)
{
    (void)state;
    // a ball with a cavity (left), an inside-out ball with an inside-out cavity (right), and an
    // inside-out ball within the left cavity
    sdm_mesh m = {0};
    append_ball(&m, 0, 3, false);
    append_ball(&m, 0, 2, true);
    append_ball(&m, 6, 2, true);
    append_ball(&m, 6, 1, false);
    append_ball(&m, 0.5, 1, true);
    sdm_exact *e = engine(&m, SDM_SIGN_AUTO, 1);
    const sdm_exact_report *r = sdm_exact_get_report(e);
    assert_true(!r->turned && !r->unioned && r->parts_turned == 3);
    assert_true(distance_on_x_axis(e, 2.5) < -0.45 && distance_on_x_axis(e, -1.5) > 0.45 &&
                distance_on_x_axis(e, 0.5) < -0.95 && distance_on_x_axis(e, 6) > 0.9 &&
                distance_on_x_axis(e, 7.5) < -0.45);
    sdm_exact_free(e);
    // the whole mesh inside out
    mesh_flip(&m);
    e = engine(&m, SDM_SIGN_AUTO, 1);
    r = sdm_exact_get_report(e);
    assert_true(r->turned && r->parts_turned == 3);
    assert_true(distance_on_x_axis(e, 2.5) < -0.45 && distance_on_x_axis(e, -1.5) > 0.45 &&
                distance_on_x_axis(e, 0.5) < -0.95 && distance_on_x_axis(e, 6) > 0.9 &&
                distance_on_x_axis(e, 7.5) < -0.45);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);

    // an inside-out part that intersects a solid is subtracted from it
    append_ball(&m, 0, 2, false);
    append_ball(&m, 2, 1, true);
    e = engine(&m, SDM_SIGN_AUTO, 1);
    assert_int_equal(sdm_exact_get_report(e)->parts_turned, 0);
    assert_true(distance_on_x_axis(e, 0) < 0 && distance_on_x_axis(e, 1.5) > 0 &&
                distance_on_x_axis(e, 2.5) > 0);
    const sdm_grid g = sdm_grid_centred((const int64_t[3]){40, 30, 30}, 0.17, zero);
    float *v = map(e, &g);
    sdm_sign_certificate c;
    assert_int_equal(sdm_exact_certify(e, &g, v, &c, NULL), SDM_OK);
    size_t below = 0;
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        double x[3];
        voxel(&g, i, x);
        below += winding(&m, x) < -0.5;
    }
    assert_true(c.wrong == 0 && below > 0 && c.below_zero == below);
    free(v);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rows_within_faces_have_right_signs),
        cmocka_unit_test(test_certificate_counts_wrong_signs),
        cmocka_unit_test(test_signs_are_applied_to_given_distances),
        cmocka_unit_test(test_scaling_and_shifting_keep_signs),
        cmocka_unit_test(test_duplicated_faces),
        cmocka_unit_test(test_inside_out_parts_are_reversed_or_subtracted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
