/* Iso-surfaces of sampled functions: closed, consistently oriented, at the level, and enclosing
 * exactly the voxels with values below the level.
 * Tests: isosurface.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/isosurface.h"

#define PI 3.14159265358979323846

/* An oblique rotation, row-major; `mirror` makes it a reflection. */
static void oblique_rotation(double dir[9], bool mirror)
{
    const double a = 0.4, b = -0.7, ca = cos(a), sa = sin(a), cb = cos(b), sb = sin(b);
    const double r[9] = {ca, -sa * cb, sa * sb, sa, ca * cb, -ca * sb, 0, sb, cb};
    for (int i = 0; i < 9; i++) dir[i] = mirror && i % 3 == 1 ? -r[i] : r[i];
}

static int compare_edges(const void *a, const void *b)
{
    const uint32_t *x = a, *y = b;
    for (int i = 0; i < 2; i++)
        if (x[i] != y[i]) return x[i] < y[i] ? -1 : 1;
    return 0;
}

/* Directed edges of a mesh, sorted: [3 n_tri][2]. */
static uint32_t *sorted_edges(const sdm_mesh *m)
{
    uint32_t *e = malloc(6 * (m->n_tri + 1) * sizeof *e);
    assert_non_null(e);
    for (size_t i = 0; i < 3 * m->n_tri; i++) {
        e[2 * i] = m->tri[i];
        e[2 * i + 1] = m->tri[i % 3 == 2 ? i - 2 : i + 1];
    }
    qsort(e, 3 * m->n_tri, 2 * sizeof *e, compare_edges);
    return e;
}

/* Number of directed edges a -> b without the opposite edge b -> a; fails if a directed edge occurs
 * twice or `allowed` (may be NULL) rejects one of the open edges. */
static size_t open_edges(const sdm_mesh *m,
                         bool (*allowed)(const sdm_mesh *, const uint32_t *, const void *),
                         const void *user)
{
    uint32_t *e = sorted_edges(m);
    size_t open = 0;
    for (size_t i = 0; i < 3 * m->n_tri; i++) {
        if (i) assert_true(compare_edges(e + 2 * i - 2, e + 2 * i) != 0);
        assert_true(e[2 * i] != e[2 * i + 1]);
        const uint32_t back[2] = {e[2 * i + 1], e[2 * i]};
        if (bsearch(back, e, 3 * m->n_tri, sizeof back, compare_edges)) continue;
        open++;
        if (allowed) assert_true(allowed(m, e + 2 * i, user));
    }
    free(e);
    return open;
}

static double volume(const sdm_mesh *m)
{
    double v = 0;
    for (size_t i = 0; i < m->n_tri; i++) {
        const double *a = m->vert + 3 * (size_t)m->tri[3 * i],
                     *b = m->vert + 3 * (size_t)m->tri[3 * i + 1];
        const double *c = m->vert + 3 * (size_t)m->tri[3 * i + 2];
        v += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
             a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return v / 6;
}

static double area(const sdm_mesh *m)
{
    double sum = 0;
    for (size_t i = 0; i < m->n_tri; i++) {
        double u[3], v[3];
        for (size_t d = 0; d < 3; d++) {
            u[d] = m->vert[3 * m->tri[3 * i + 1] + d] - m->vert[3 * m->tri[3 * i] + d];
            v[d] = m->vert[3 * m->tri[3 * i + 2] + d] - m->vert[3 * m->tri[3 * i] + d];
        }
        const double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                             u[0] * v[1] - u[1] * v[0]};
        sum += 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    }
    return sum;
}

static long euler(const sdm_mesh *m)
{
    return (long)m->n_vert - (long)(3 * m->n_tri / 2) + (long)m->n_tri;
}

/* Winding number of a closed mesh around x by solid angles (van Oosterom and Strackee 1983). */
static double winding(const sdm_mesh *m, const double x[3])
{
    double sum = 0;
    for (size_t i = 0; i < m->n_tri; i++) {
        double p[3][3], l[3], dot[3];
        for (size_t c = 0; c < 3; c++)
            for (size_t d = 0; d < 3; d++) p[c][d] = m->vert[3 * m->tri[3 * i + c] + d] - x[d];
        for (int c = 0; c < 3; c++)
            l[c] = sqrt(p[c][0] * p[c][0] + p[c][1] * p[c][1] + p[c][2] * p[c][2]);
        for (int c = 0; c < 3; c++) {
            const double *a = p[c], *b = p[(c + 1) % 3];
            dot[c] = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        }
        const double det = p[0][0] * (p[1][1] * p[2][2] - p[1][2] * p[2][1]) +
                           p[0][1] * (p[1][2] * p[2][0] - p[1][0] * p[2][2]) +
                           p[0][2] * (p[1][0] * p[2][1] - p[1][1] * p[2][0]);
        sum += 2 * atan2(det, l[0] * l[1] * l[2] + dot[0] * l[2] + dot[1] * l[0] + dot[2] * l[1]);
    }
    return sum / (4 * PI);
}

typedef double (*solid)(const double x[3]);

static double ball(const double x[3])
{
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 3.0;
}

static double ring(const double x[3])
{
    const double r = sqrt(x[0] * x[0] + x[1] * x[1]) - 3.0;
    return sqrt(r * r + x[2] * x[2]) - 1.2;
}

/* Samples f on an oblique grid around the origin with different sizes and spacings along the axes
 * (caller frees). */
static float *sample_on_oblique_grid(sdm_grid *g, bool mirror, solid f)
{
    *g = (sdm_grid){.n = {52, 45, 60}, .spacing = {0.2, 0.25, 0.17}};
    oblique_rotation(g->dir, mirror);
    const double middle[3] = {25.7, 22.1, 29.4}, zero[3] = {0};
    double at[3];
    sdm_grid_world(g, middle, at);
    for (int d = 0; d < 3; d++) g->origin[d] = zero[d] - at[d];
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    assert_non_null(v);
    for (int64_t k = 0, i = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t x = 0; x < g->n[0]; x++) {
                const double index[3] = {(double)x, (double)j, (double)k};
                sdm_grid_world(g, index, at);
                v[i++] = (float)f(at);
            }
    return v;
}

static void check_surface(solid f, bool mirror, float level, double true_volume, double true_area,
                          long true_euler)
{
    sdm_grid g;
    float *v = sample_on_oblique_grid(&g, mirror, f);
    sdm_mesh m = {0};
    sdm_error err;
    bool cut = true;
    assert_int_equal(sdm_isosurface(&g, v, level, &m, &cut, &err), SDM_OK);
    assert_false(cut);
    assert_int_equal(open_edges(&m, NULL, NULL), 0);
    assert_int_equal(euler(&m), true_euler);
    assert_true(fabs(volume(&m) / true_volume - 1) < 0.01);
    assert_true(fabs(area(&m) / true_area - 1) < 0.01);
    /* error of linear interpolation along an edge of length h = 0.25: at most h^2 / 8 *
     * curvature */
    for (size_t i = 0; i < m.n_vert; i++)
        assert_true(fabs(f(m.vert + 3 * i) - (double)level) < 0.25 * 0.25 / 8 / 1.0 + 1e-4);
    sdm_mesh_dispose(&m);
    free(v);
}

static void test_surface_of_ball(void **state)
{
    (void)state;
    check_surface(ball, false, 0, 4 * PI / 3 * 27, 4 * PI * 9, 2);
    check_surface(ball, true, 0, 4 * PI / 3 * 27, 4 * PI * 9, 2);
    check_surface(ball, false, 0.75f, 4 * PI / 3 * 3.75 * 3.75 * 3.75, 4 * PI * 3.75 * 3.75, 2);
}

static void test_surface_of_torus(void **state)
{
    (void)state;
    check_surface(ring, false, 0, 2 * PI * PI * 3 * 1.44, 4 * PI * PI * 3 * 1.2, 0);
    check_surface(ring, true, 0, 2 * PI * PI * 3 * 1.44, 4 * PI * PI * 3 * 1.2, 0);
}

/* Fills v with random noise: uniform in [-1, 1] for steps = 0, else integers from -steps to steps.
 * `closed` makes all border voxels positive (outside). */
static void fill_noise(float *v, const int64_t n[3], uint64_t seed, int steps, bool closed)
{
    for (int64_t k = 0, i = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (int64_t x = 0; x < n[0]; x++, i++) {
                const double u = 2 * sdm_rng_uniform(seed, 1, (uint64_t)i) - 1;
                v[i] = (float)(steps ? round(u * steps) : u);
                const bool border =
                    x == 0 || j == 0 || k == 0 || x == n[0] - 1 || j == n[1] - 1 || k == n[2] - 1;
                if (closed && border) v[i] = fabsf(v[i]) + 0.5f;
            }
}

/* Noise covers all cases of the cell table including the ambiguous ones. The surface must be
 * closed, with winding number 1 around voxels below the level and 0 around all others. */
static void test_noise_is_enclosed_exactly(void **state)
{
    (void)state;
    sdm_grid g = {.n = {7, 6, 8}, .spacing = {0.5, 0.8, 1.1}, .origin = {1, -2, 3}};
    float v[7 * 6 * 8];
    for (uint64_t seed = 0; seed < 60; seed++) {
        sdm_mesh m = {0};
        sdm_error err;
        bool cut = true;
        oblique_rotation(g.dir, seed % 2);
        fill_noise(v, g.n, seed, (int)(seed % 3), true);
        assert_int_equal(sdm_isosurface(&g, v, 0, &m, &cut, &err), SDM_OK);
        assert_false(cut);
        assert_true(m.n_tri > 0);
        assert_int_equal(open_edges(&m, NULL, NULL), 0);
        for (int i = 0; i < 7 * 6 * 8; i++) {
            const double index[3] = {i % 7, i / 7 % 6, i / 42};
            double x[3];
            sdm_grid_world(&g, index, x);
            assert_true(fabs(winding(&m, x) - (v[i] < 0 ? 1 : 0)) < 1e-6);
        }
        sdm_mesh_dispose(&m);
    }
}

/* Do both ends of an edge lie on the same face of the grid's bounding box? */
static bool on_border(const sdm_mesh *m, const uint32_t *edge, const void *user)
{
    const sdm_grid *g = user;
    double a[3], b[3];
    sdm_grid_index(g, m->vert + 3 * (size_t)edge[0], a);
    sdm_grid_index(g, m->vert + 3 * (size_t)edge[1], b);
    for (int d = 0; d < 3; d++) {
        const double last = (double)g->n[d] - 1;
        if ((fabs(a[d]) < 1e-9 && fabs(b[d]) < 1e-9) ||
            (fabs(a[d] - last) < 1e-9 && fabs(b[d] - last) < 1e-9))
            return true;
    }
    return false;
}

static void test_noise_is_open_at_the_border_only(void **state)
{
    (void)state;
    sdm_grid g = {.n = {9, 7, 8}, .spacing = {0.5, 0.8, 1.1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    float v[9 * 7 * 8];
    for (uint64_t seed = 0; seed < 40; seed++) {
        sdm_mesh m = {0};
        sdm_error err;
        bool cut = false;
        fill_noise(v, g.n, seed, (int)(seed % 3), false);
        assert_int_equal(sdm_isosurface(&g, v, 0.1f, &m, &cut, &err), SDM_OK);
        assert_true(cut);
        assert_true(open_edges(&m, on_border, &g) > 0);
        sdm_mesh_dispose(&m);
    }
}

/* Values equal to the level must not produce triangles of zero area. */
static void test_values_equal_to_level_give_no_empty_triangles(void **state)
{
    (void)state;
    const double middle[3] = {0};
    const int64_t n[3] = {9, 9, 9};
    const sdm_grid g = sdm_grid_centred(n, 1.0, middle);
    float v[729];
    for (int i = 0; i < 729; i++)
        v[i] = (float)(abs(i % 9 - 4) + abs(i / 9 % 9 - 4) + abs(i / 81 - 4) - 3);
    sdm_mesh m = {0};
    sdm_error err;
    assert_int_equal(sdm_isosurface(&g, v, 0, &m, NULL, &err), SDM_OK);
    assert_int_equal(open_edges(&m, NULL, NULL), 0);
    for (size_t i = 0; i < m.n_tri; i++) {
        const sdm_mesh one = {.vert = m.vert, .tri = m.tri + 3 * i, .n_vert = m.n_vert, .n_tri = 1};
        assert_true(area(&one) > 1e-9);
    }
    assert_true(fabs(volume(&m) - 4.0 / 3 * 27) < 0.01); /* volume of an octahedron of radius 3 */
    sdm_mesh_dispose(&m);
}

static void test_result_is_reproducible(void **state)
{
    (void)state;
    sdm_grid g;
    float *v = sample_on_oblique_grid(&g, false, ring);
    sdm_mesh a = {0}, b = {0};
    sdm_error err;
    assert_int_equal(sdm_isosurface(&g, v, 0, &a, NULL, &err), SDM_OK);
    assert_int_equal(sdm_isosurface(&g, v, 0, &b, NULL, &err), SDM_OK);
    assert_true(a.n_vert == b.n_vert && a.n_tri == b.n_tri);
    assert_memory_equal(a.vert, b.vert, 3 * a.n_vert * sizeof *a.vert);
    assert_memory_equal(a.tri, b.tri, 3 * a.n_tri * sizeof *a.tri);
    sdm_mesh_dispose(&a);
    sdm_mesh_dispose(&b);
    free(v);
}

static void test_empty_surface(void **state)
{
    (void)state;
    sdm_grid g = {.n = {2, 3, 4}, .spacing = {1, 1, 1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    float v[24];
    sdm_mesh m = {0};
    sdm_error err;
    bool cut = true;
    for (int i = 0; i < 24; i++) v[i] = 1;
    assert_int_equal(sdm_isosurface(&g, v, 0, &m, &cut, &err), SDM_OK);
    assert_int_equal(m.n_tri, 0);
    assert_false(cut);
    /* a grid of one layer has no cells, but the inside touches its border: cut is true */
    g.n[2] = 1;
    v[0] = -1;
    assert_int_equal(sdm_isosurface(&g, v, 0, &m, &cut, &err), SDM_OK);
    assert_int_equal(m.n_tri, 0);
    assert_int_equal(m.n_vert, 0);
    assert_true(cut);
    sdm_mesh_dispose(&m);
}

static void test_invalid_arguments_and_failed_allocations(void **state)
{
    (void)state;
    sdm_grid g = {.n = {2, 2, 2}, .spacing = {1, 1, 1}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    float v[8] = {-1, 1, 1, 1, 1, 1, 1, 1};
    sdm_mesh m = {0};
    sdm_error err;
    assert_int_equal(sdm_isosurface(NULL, v, 0, &m, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_isosurface(&g, NULL, 0, &m, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_isosurface(&g, v, 0, NULL, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_isosurface(&g, v, NAN, &m, NULL, &err), SDM_E_ARG);
    v[5] = NAN;
    assert_int_equal(sdm_isosurface(&g, v, 0, &m, NULL, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "voxel 5"));
    v[5] = INFINITY;
    assert_int_equal(sdm_isosurface(&g, v, 0, &m, NULL, &err), SDM_E_ARG);
    v[5] = 1;
    g.n[0] = 0;
    assert_int_equal(sdm_isosurface(&g, v, 0, &m, NULL, &err), SDM_E_ARG);
    g.n[0] = 2;
    unsigned long n = 1;
    for (;; n++) {
        sdm_alloc_fail_after(n);
        const sdm_status s = sdm_isosurface(&g, v, 0, &m, NULL, &err);
        sdm_alloc_fail_after(0);
        if (s == SDM_OK) break;
        assert_int_equal(s, SDM_E_NOMEM);
        assert_true(m.vert == NULL && m.tri == NULL);
    }
    assert_true(n > 1);
    assert_int_equal(m.n_tri, 1);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_surface_of_ball),
        cmocka_unit_test(test_surface_of_torus),
        cmocka_unit_test(test_noise_is_enclosed_exactly),
        cmocka_unit_test(test_noise_is_open_at_the_border_only),
        cmocka_unit_test(test_values_equal_to_level_give_no_empty_triangles),
        cmocka_unit_test(test_result_is_reproducible),
        cmocka_unit_test(test_empty_surface),
        cmocka_unit_test(test_invalid_arguments_and_failed_allocations),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
