/* Derivatives of exact maps with respect to moving vertices: motions of whole meshes, and of single
 * sheets that intersect in a union.
 * Tests: layers.c vertex_gradient.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/exact_tools.h"
#include "sdm/exact.h"
#include "sdm/internal/rng.h"

#define PI 3.14159265358979323846

static const double ZERO[3] = {0, 0, 0};

/* ---- motions of whole meshes ---- */

/* Translating a mesh by v changes the distance at the rate -n . v, scaling it changes it at the
 * rate d - n . x. Both hold exactly, also on needles and triangles of zero area, because the
 * barycentric weights must reproduce the nearest point. */
static void check_motions(const sdm_mesh *m, const sdm_exact_opts *o, const sdm_grid *g,
                          double tolerance)
{
    sdm_error err = {0};
    const size_t n = sdm_grid_count(g), nv = m->n_vert;
    double *velocity = room(4 * 3 * nv, sizeof *velocity);
    float *d = room(n, sizeof *d), *normal = room(3 * n, sizeof *normal),
          *slope = room(4 * n, sizeof *slope);
    for (size_t v = 0; v < nv; v++)
        for (size_t a = 0; a < 3; a++) {
            velocity[3 * (a * nv + v) + a] = 1;
            velocity[3 * (3 * nv + v) + a] = m->vert[3 * v + a];
        }
    sdm_exact *e = engine(m, o);
    const sdm_exact_layers l = {.values = d, .normal = normal};
    if (sdm_exact_map_derivative(e, g, velocity, 4, &l, slope, &err)) fail_msg("%s", err.text);
    for (size_t i = 0; i < n; i++) {
        double x[3], grow = (double)d[i];
        position(g, i, x);
        for (size_t a = 0; a < 3; a++) {
            assert_true(fabs((double)slope[a * n + i] + (double)normal[3 * i + a]) < 1e-6);
            grow -= x[a] * (double)normal[3 * i + a];
        }
        assert_true(fabs((double)slope[3 * n + i] - grow) < tolerance);
    }
    sdm_exact_free(e);
    free(velocity);
    free(d);
    free(normal);
    free(slope);
}

static void test_translation_and_scaling(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_grid g = sdm_grid_centred((int64_t[3]){11, 12, 13}, 0.3, (double[3]){0.01, 0.02, 0.03});
    mesh_sphere(&m, ZERO, 1.2, 9);
    check_motions(&m, NULL, &g, 3e-6);
    mesh_flip(&m);
    check_motions(&m, NULL, &g, 3e-6);
    m.n_tri -= 30;
    check_motions(&m, NULL, &g, 3e-6);
    for (uint64_t round = 0; round < 20; round++) {
        // triangles of all kinds: general, needles, segments, points
        const size_t n = 20;
        mesh_make(&m, 3 * n, n);
        for (uint64_t i = 0; i < 9 * n; i++) m.vert[i] = 2 * sdm_rng_uniform(3, round, i) - 1;
        for (size_t t = 0; t < n; t++) {
            double *v = m.vert + 9 * t;
            for (size_t a = 0; a < 3; a++) {
                if (t % 5 == 1) v[3 + a] = v[a] + 1e-9 * v[3 + a];
                if (t % 5 == 2) v[6 + a] = v[a] + 0.3 * (v[3 + a] - v[a]);
                if (t % 5 == 3) v[3 + a] = v[6 + a] = v[a];
            }
            mesh_triangle(&m, t, 3 * t, 3 * t + 1, 3 * t + 2);
        }
        check_motions(&m, NULL, &g, 3e-6);
    }
    mesh_spiral(&m, &SPIRAL_NOMINAL, 0.6);
    g = sdm_grid_centred((int64_t[3]){20, 20, 20}, 0.6, (double[3]){0, 0, 1.5});
    check_motions(&m, NULL, &g, 2e-5);
    check_motions(&m, &(sdm_exact_opts){.keep_overlap = true}, &g, 2e-5);
    sdm_mesh_dispose(&m);
}

/* ---- sheets that intersect in a union ---- */

/* Three boxes whose union leaves one octant free, with its vertex at the origin. Shifting box k
 * along axis k by p_k moves this vertex along axis k; shifts along other axes change nothing.
 * Inside the union d = -norm(max(p - x, 0)); outside, the nearest face decides. */
static void test_three_sheets_move_their_vertex(void **state)
{
    (void)state;
    const double lo[3][3] = {{-9, -8, -8.3}, {-8.1, -9.3, -8.4}, {-8.5, -8.6, -9.7}};
    const double hi[3][3] = {{0, 8.2, 8.1}, {8.2, 0, 8.5}, {8.3, 8.4, 0}};
    sdm_error err = {0};
    sdm_mesh m = {0}, box = {0};
    mesh_box(&m, lo[0], hi[0]);
    for (int b = 1; b < 3; b++) {
        mesh_box(&box, lo[b], hi[b]);
        mesh_append(&m, &box);
    }
    // parameter 3 b + a shifts box b along axis a
    double *velocity = room(9 * 3 * m.n_vert, sizeof *velocity);
    for (size_t k = 0; k < 9; k++)
        for (size_t v = 8 * (k / 3); v < 8 * (k / 3) + 8; v++)
            velocity[3 * (k * m.n_vert + v) + k % 3] = 1;
    sdm_exact *e = engine(&m, NULL);
    assert_true(sdm_exact_get_report(e)->unioned);
    const sdm_grid g =
        sdm_grid_centred((int64_t[3]){16, 16, 16}, 0.237, (double[3]){0.003, 0.002, 0.001});
    const size_t n = sdm_grid_count(&g);
    float *d = room(n, sizeof *d), *slope = room(9 * n, sizeof *slope);
    if (sdm_exact_map_derivative(e, &g, velocity, 9, &(sdm_exact_layers){.values = d}, slope, &err))
        fail_msg("%s", err.text);
    size_t with[4] = {0};
    for (size_t i = 0; i < n; i++) {
        double x[3], below = 0, wanted[3], nearest = INFINITY;
        int sheets = 0;
        position(&g, i, x);
        for (int a = 0; a < 3; a++) {
            below += x[a] < 0 ? x[a] * x[a] : 0;
            sheets += x[a] < 0;
            nearest = fmin(nearest, x[a]);
        }
        for (int a = 0; a < 3; a++)
            wanted[a] = sheets ? (x[a] < 0 ? x[a] / sqrt(below) : 0) : x[a] == nearest ? -1 : 0;
        assert_true(fabs((double)d[i] - (sheets ? -sqrt(below) : nearest)) < 1e-6);
        for (size_t k = 0; k < 9; k++)
            assert_true(fabs((double)slope[k * n + i] - (k / 3 == k % 3 ? wanted[k / 3] : 0)) <
                        2e-6);
        with[sheets]++;
    }
    for (int s = 0; s < 4; s++) assert_true(with[s] > n / 10);
    free(d);
    free(slope);
    free(velocity);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&box);
}

/* Four boxes whose union leaves a pyramid free, with its apex at the origin. Shifting one box does
 * not move the apex in a unique way, but the contributions of the sheets must be >= 0 (a growing
 * solid reduces the distance) and, multiplied by the sheets' normals, add up to the gradient. */
static void test_four_sheets_add_up_to_gradient(void **state)
{
    (void)state;
    sdm_error err = {0};
    sdm_mesh m = {0}, box = {0};
    double out[4][3];
    for (int b = 0; b < 4; b++) {
        // the box below the plane z = 0, tilted by 45 degrees and rotated about z
        const double c = cos(PI / 2 * b), s = sin(PI / 2 * b), r = sqrt(0.5);
        const double axis[3][3] = {{r * c, r * s, -r}, {-s, c, 0}, {r * c, r * s, r}};
        mesh_box(&box, (double[3]){-8 - 0.1 * b, -9, -9 - 0.3 * b},
                 (double[3]){8.2, 8.3 + 0.2 * b, 0});
        for (size_t v = 0; v < 8; v++) {
            const double x[3] = {box.vert[3 * v], box.vert[3 * v + 1], box.vert[3 * v + 2]};
            for (size_t a = 0; a < 3; a++)
                box.vert[3 * v + a] = x[0] * axis[0][a] + x[1] * axis[1][a] + x[2] * axis[2][a];
        }
        memcpy(out[b], axis[2], sizeof out[b]);
        mesh_append(&m, &box);
    }
    double *velocity = room(4 * 3 * m.n_vert, sizeof *velocity);
    for (size_t b = 0; b < 4; b++)
        for (size_t v = 8 * b; v < 8 * b + 8; v++)
            for (size_t a = 0; a < 3; a++) velocity[3 * (b * m.n_vert + v) + a] = out[b][a];
    sdm_exact *e = engine(&m, NULL);
    const sdm_grid g =
        sdm_grid_centred((int64_t[3]){12, 12, 12}, 0.237, (double[3]){0.003, 0.002, -1.2});
    const size_t n = sdm_grid_count(&g);
    float *normal = room(3 * n, sizeof *normal), *slope = room(4 * n, sizeof *slope);
    if (sdm_exact_map_derivative(e, &g, velocity, 4, &(sdm_exact_layers){.normal = normal}, slope,
                                 &err))
        fail_msg("%s", err.text);
    size_t with[5] = {0};
    for (size_t i = 0; i < n; i++) {
        int sheets = 0;
        double rest[3] = {(double)normal[3 * i], (double)normal[3 * i + 1],
                          (double)normal[3 * i + 2]};
        for (size_t b = 0; b < 4; b++) {
            const double part = -(double)slope[b * n + i];
            assert_true(part > -1e-5);
            for (int a = 0; a < 3; a++) rest[a] -= part * out[b][a];
            sheets += part > 1e-5;
        }
        for (int a = 0; a < 3; a++) assert_true(fabs(rest[a]) < 1e-5);
        with[sheets]++;
    }
    assert_true(with[1] && with[2] && with[3] > n / 10 && !with[4]);
    free(normal);
    free(slope);
    free(velocity);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&box);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_translation_and_scaling),
        cmocka_unit_test(test_three_sheets_move_their_vertex),
        cmocka_unit_test(test_four_sheets_add_up_to_gradient),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
