/* Layers of the exact engine's maps (nearest triangle, closest point, gradient), compared with
 * single points, finite differences and geometry.
 * Tests: exact.c pseudonormal.c sign.c */
#include <limits.h>
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
#include "sdm/internal/rng.h"

typedef struct layers {
    sdm_grid grid;
    size_t n;
    sdm_exact_layers l;
} layers;

static layers layers_make(const sdm_exact *e, const sdm_grid *g)
{
    sdm_error err = {0};
    layers r = {.grid = *g, .n = sdm_grid_count(g)};
    r.l = (sdm_exact_layers){.values = room(r.n, sizeof(float)),
                             .closest = room(3 * r.n, sizeof(float)),
                             .normal = room(3 * r.n, sizeof(float)),
                             .triangle = room(r.n, sizeof(uint32_t))};
    if (sdm_exact_map_layers(e, g, &r.l, &err)) fail_msg("%s", err.text);
    return r;
}

static void layers_dispose(layers *r)
{
    free(r->l.values);
    free(r->l.closest);
    free(r->l.normal);
    free(r->l.triangle);
}

/* Distance from x to triangle t of m, by sdm_naive_point(). */
static double distance_to_triangle(const sdm_mesh *m, uint32_t t, const double x[3])
{
    double vert[9];
    uint32_t tri[3] = {0, 1, 2};
    for (size_t i = 0; i < 9; i++)
        vert[i] = m->vert[3 * (size_t)m->tri[3 * (size_t)t + i / 3] + i % 3];
    return fabs(sdm_naive_point(&(sdm_mesh){.vert = vert, .tri = tri, .n_vert = 3, .n_tri = 1}, x));
}

/* Compares every layer with sdm_exact_point() and checks how the layers are related geometrically.
 * size: largest abs(coordinate), for the rounding to float. */
static void check_layers(const sdm_exact *e, const layers *r, double size)
{
    const sdm_mesh *surface = sdm_exact_surface(e);
    const double rounding = 1.2e-7 * size;
    float *map = room(r->n, sizeof *map);
    assert_int_equal(sdm_exact_map(e, &r->grid, map, NULL), SDM_OK);
    assert_memory_equal(map, r->l.values, r->n * sizeof *map);
    free(map);
    size_t same = 0;
    for (size_t i = 0; i < r->n; i++) {
        double x[3], q[3], n[3], away[3], dot = 0, length = 0, distance = 0;
        uint32_t t;
        position(&r->grid, i, x);
        const double d = sdm_exact_point(e, x, q, n, &t);
        const float *normal = r->l.normal + 3 * i, *closest = r->l.closest + 3 * i;
        // tolerance: the rounding of coordinates, which is less than one float ulp of all but the
        // smallest distances
        assert_true(r->l.values[i] == (float)d || fabs((double)r->l.values[i] - d) < 1e-15 * size);
        assert_true(r->l.triangle[i] < surface->n_tri);
        for (int a = 0; a < 3; a++) {
            away[a] = x[a] - (double)closest[a];
            dot += away[a] * (double)normal[a];
            length += (double)normal[a] * (double)normal[a];
            distance += away[a] * away[a];
        }
        assert_true(fabs(length - 1) < 1e-6);
        // (x - closest) / d = normal
        assert_true(fabs(sqrt(distance) - fabs(d)) <= 2 * rounding &&
                    fabs(dot - d) <= 2 * rounding);
        const double cq[3] = {(double)closest[0], (double)closest[1], (double)closest[2]};
        assert_true(distance_to_triangle(surface, r->l.triangle[i], cq) <= rounding);
        if (t != r->l.triangle[i]) {
            assert_true(fabs(distance_to_triangle(surface, r->l.triangle[i], x) - fabs(d)) <=
                        1e-14 * size);
            continue;
        }
        same++;
        for (int a = 0; a < 3; a++)
            assert_true(closest[a] == (float)q[a] && normal[a] == (float)n[a]);
    }
    assert_true(same > r->n * 9 / 10);
}

static sdm_grid tilted_grid(const double centre[3], double half)
{
    const double c = cos(0.3), s = sin(0.3);
    const double dir[9] = {c, -s, 0, -s, -c, 0, 0, 0, 1}; // a rotation and a reflection
    sdm_grid g = {.n = {13, 11, 12}};
    memcpy(g.dir, dir, sizeof dir);
    const double index[3] = {6, 5, 5.5};
    for (int a = 0; a < 3; a++) g.spacing[a] = half / index[a];
    sdm_grid_world(&g, index, g.origin);
    for (int a = 0; a < 3; a++) g.origin[a] = centre[a] - g.origin[a];
    return g;
}

static const double ZERO[3] = {0, 0, 0};

static void check_mesh(const sdm_mesh *m, const sdm_exact_opts *o, const sdm_grid *g, double size)
{
    sdm_exact *e = engine(m, o);
    layers r = layers_make(e, g);
    check_layers(e, &r, size);
    layers_dispose(&r);
    sdm_exact_free(e);
}

static void test_layers_match_points(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_grid g = tilted_grid(ZERO, 1.7);
    mesh_sphere(&m, ZERO, 1.2, 9);
    check_mesh(&m, NULL, &g, 4);
    mesh_flip(&m); // inside-out mesh
    check_mesh(&m, NULL, &g, 4);
    m.n_tri -= 40; // open mesh
    check_mesh(&m, NULL, &g, 4);
    mesh_box(&m, (double[3]){-1, -0.5, -1}, (double[3]){0.7, 1, 1.1});
    check_mesh(&m, &(sdm_exact_opts){.sign = SDM_SIGN_PSEUDONORMAL}, &g, 4);
    // voxels on faces, edges and corners, near the origin and far from it
    for (double far = 0; far < 1e7; far += 4194304) {
        mesh_box(&m, (double[3]){far - 1, far - 1, far - 1},
                 (double[3]){far + 1, far + 1, far + 1});
        const sdm_grid on =
            sdm_grid_centred((int64_t[3]){9, 9, 9}, 0.5, (double[3]){far, far, far});
        check_mesh(&m, NULL, &on, far + 2);
    }
    // on an oblique face far from the origin the rounding of coordinates exceeds the distance
    const double far = 4194304.7;
    mesh_make(&m, 4, 4);
    for (size_t v = 0; v < 4; v++)
        mesh_vertex(&m, v, far + (v == 1 ? 7 : 0), far + (v == 2 ? 7 : 0), far + (v == 3 ? 7 : 0));
    static const uint8_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    for (size_t t = 0; t < 4; t++) mesh_triangle(&m, t, faces[t][0], faces[t][1], faces[t][2]);
    const sdm_grid on = {.n = {8, 8, 8},
                         .origin = {far, far, far},
                         .spacing = {1, 1, 1},
                         .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    check_mesh(&m, NULL, &on, far + 8);
    mesh_spiral(&m, &SPIRAL_NOMINAL, 0.6);
    g = tilted_grid((double[3]){0, 0, 1.5}, 5);
    check_mesh(&m, NULL, &g, 12);
    check_mesh(&m, &(sdm_exact_opts){.keep_overlap = true}, &g, 12);
    sdm_mesh_dispose(&m);
}

/* Compares the gradient with central differences wherever forward and backward differences
 * agree, that is, where the distance is smooth. At least the share `wanted` of all samples must
 * be smooth. */
static void check_gradient(const sdm_mesh *m, const sdm_exact_opts *o, const sdm_grid *g,
                           double wanted)
{
    const double h = 1e-5;
    sdm_exact *e = engine(m, o);
    layers r = layers_make(e, g);
    size_t smooth = 0;
    for (size_t i = 0; i < 3 * r.n; i++) {
        double x[3];
        position(g, i / 3, x);
        const double middle = x[i % 3], d = sdm_exact_point(e, x, NULL, NULL, NULL);
        x[i % 3] = middle + h;
        const double forward = (sdm_exact_point(e, x, NULL, NULL, NULL) - d) / h;
        x[i % 3] = middle - h;
        const double backward = (d - sdm_exact_point(e, x, NULL, NULL, NULL)) / h;
        if (fabs(forward - backward) > 1e-3) continue;
        smooth++;
        assert_true(fabs((forward + backward) / 2 - (double)r.l.normal[i]) < 1e-3);
    }
    assert_true((double)smooth > wanted * 3 * (double)r.n);
    layers_dispose(&r);
    sdm_exact_free(e);
}

static void test_gradient_matches_differences(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    sdm_grid g = tilted_grid(ZERO, 1.7);
    mesh_sphere(&m, ZERO, 1.2, 9);
    check_gradient(&m, NULL, &g, 0.98);
    mesh_flip(&m);
    check_gradient(&m, NULL, &g, 0.98);
    mesh_spiral(&m, &SPIRAL_NOMINAL, 0.6);
    g = tilted_grid((double[3]){0, 0, 1.5}, 5);
    check_gradient(&m, NULL, &g, 0.98);
    check_gradient(&m, &(sdm_exact_opts){.keep_overlap = true}, &g, 0.98);
    sdm_mesh_dispose(&m);
}

/* On the surface of a box the normal is the outward normal of a face. */
static void test_normals_on_the_surface(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_box(&m, (double[3]){-1, -1, -1}, (double[3]){1, 1, 1});
    for (int turned = 0; turned < 2; turned++) {
        if (turned) mesh_flip(&m);
        const sdm_grid g = sdm_grid_centred((int64_t[3]){5, 5, 5}, 0.5, ZERO);
        sdm_exact *e = engine(&m, NULL);
        layers r = layers_make(e, &g);
        size_t n = 0;
        for (size_t i = 0; i < r.n; i++) {
            if (fabs((double)r.l.values[i]) > 1e-12) continue;
            double x[3];
            position(&g, i, x);
            const float *v = r.l.normal + 3 * i;
            for (int a = 0; a < 3; a++)
                if (v[a] != 0) assert_true(fabs((double)v[a]) == 1 && (double)v[a] == x[a]);
            n++;
        }
        assert_int_equal(n, 98);
        layers_dispose(&r);
        sdm_exact_free(e);
    }
    sdm_mesh_dispose(&m);
}

static void test_threads_and_choice_of_layers(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_spiral(&m, &SPIRAL_NOMINAL, 0.6);
    const sdm_grid g = tilted_grid((double[3]){0, 0, 1.5}, 5);
    sdm_exact *one = engine(&m, &(sdm_exact_opts){.n_threads = 1});
    layers a = layers_make(one, &g);
    for (int n_threads = 2; n_threads <= 3; n_threads++) {
        sdm_exact *e = engine(&m, &(sdm_exact_opts){.n_threads = n_threads});
        layers b = layers_make(e, &g);
        assert_memory_equal(a.l.values, b.l.values, a.n * sizeof(float));
        assert_memory_equal(a.l.closest, b.l.closest, 3 * a.n * sizeof(float));
        assert_memory_equal(a.l.normal, b.l.normal, 3 * a.n * sizeof(float));
        assert_memory_equal(a.l.triangle, b.l.triangle, a.n * sizeof(uint32_t));
        layers_dispose(&b);
        sdm_exact_free(e);
    }
    // a single layer gives the same result
    layers c = {.n = a.n, .l = {.normal = room(3 * a.n, sizeof(float))}};
    assert_int_equal(sdm_exact_map_layers(one, &g, &c.l, NULL), SDM_OK);
    assert_memory_equal(a.l.normal, c.l.normal, 3 * a.n * sizeof(float));
    layers_dispose(&c);
    // no layer at all is allowed
    assert_int_equal(sdm_exact_map_layers(one, &g, &(sdm_exact_layers){0}, NULL), SDM_OK);
    layers_dispose(&a);
    sdm_exact_free(one);
    sdm_mesh_dispose(&m);
}

static int calls;
static bool cancel_after_patience(void *user) { return calls++ >= *(const int *)user; }

static void test_invalid_arguments_and_cancellation(void **state)
{
    (void)state;
    sdm_error err = {0};
    sdm_mesh m = {0};
    mesh_box(&m, (double[3]){-1, -1, -1}, (double[3]){1, 1, 1});
    sdm_exact *e = engine(&m, NULL);
    sdm_grid g = sdm_grid_centred((int64_t[3]){60, 60, 60}, 0.05, ZERO);
    uint32_t *triangle = room(sdm_grid_count(&g), sizeof *triangle);
    float *values = room(sdm_grid_count(&g), sizeof *values);
    const sdm_exact_layers l = {.triangle = triangle};
    assert_int_equal(sdm_exact_map_layers(NULL, &g, &l, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_layers(e, NULL, &l, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_layers(e, &g, NULL, &err), SDM_E_ARG);
    g.spacing[1] = 0;
    assert_int_equal(sdm_exact_map_layers(e, &g, &l, &err), SDM_E_ARG);
    g.spacing[1] = 0.05;
    sdm_exact_free(e);

    e = engine(&m, &(sdm_exact_opts){.memory_limit = 400000});
    assert_int_equal(sdm_exact_map_layers(e, &g, &l, &err), SDM_E_NOMEM);
    assert_non_null(strstr(err.text, "1728000"));
    sdm_exact_free(e);

    // The callback is called first by the map, then by the layers. patience = number of calls
    // before it requests a stop: never, at the last call, at the first call.
    int patience = INT_MAX;
    e = engine(&m, &(sdm_exact_opts){
                       .n_threads = 1, .cancelled = cancel_after_patience, .user = &patience});
    calls = 0;
    assert_int_equal(sdm_exact_map(e, &g, values, &err), SDM_OK);
    const int of_map = calls;
    calls = 0;
    assert_int_equal(sdm_exact_map_layers(e, &g, &l, &err), SDM_OK);
    assert_true(calls > of_map);
    patience = calls - 1;
    for (int i = 0; i < 2; i++) {
        calls = 0;
        assert_int_equal(sdm_exact_map_layers(e, &g, &l, &err), SDM_E_CANCELLED);
        patience = 0;
    }
    sdm_exact_free(e);

    e = engine(&m, NULL);
    sdm_alloc_fail_after(1);
    assert_int_equal(sdm_exact_map_layers(e, &g, &l, &err), SDM_E_NOMEM);
    sdm_alloc_fail_after(0);
    sdm_exact_free(e);
    free(triangle);
    free(values);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_layers_match_points),
        cmocka_unit_test(test_gradient_matches_differences),
        cmocka_unit_test(test_normals_on_the_surface),
        cmocka_unit_test(test_threads_and_choice_of_layers),
        cmocka_unit_test(test_invalid_arguments_and_cancellation),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
