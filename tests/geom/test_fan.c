/* Fans, the triangles around a vertex: sdm_fans_visit() may skip pairs of triangles only if they
 * share nothing but a common vertex or edge, which is checked in exact integer arithmetic.
 * Tests: fan.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/internal/rng.h"
#include "solid/fan.h"

#define PI 3.14159265358979323846
#define REACH 1e6 // determinants of integer coordinates up to REACH fit into 64 bits

static sdm_status visit_count(void *user, uint32_t i, uint32_t j, int shared)
{
    (void)i, (void)j;
    assert_in_range(shared, 1, 3);
    ++*(size_t *)user;
    return SDM_OK;
}

static size_t visits_of(const sdm_mesh *m)
{
    sdm_arena arena = {0};
    sdm_topology topo = {0};
    double largest = 0, area, volume;
    for (size_t i = 0; i < 3 * m->n_vert; i++) largest = fmax(largest, fabs(m->vert[i]));
    sdm_facet *facets = malloc(m->n_tri * sizeof *facets);
    size_t n = 0;
    assert_non_null(facets);
    sdm_facets_build(m, (const double[3]){0, 0, 0}, facets, &area, &volume);
    assert_int_equal(sdm_topology_build(m, &arena, &topo, NULL), SDM_OK);
    const double tolerance = 16 * 0x1p-52 * largest;
    assert_int_equal(sdm_fans_visit(m, &topo, facets, tolerance, &arena, visit_count, &n, NULL),
                     SDM_OK);
    sdm_arena_dispose(&arena);
    free(facets);
    return n;
}

static int det_sign(const int64_t a[3], const int64_t b[3], const int64_t c[3])
{
    const int64_t d = a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                      a[2] * (b[0] * c[1] - b[1] * c[0]);
    return (d > 0) - (d < 0);
}

/* Sign of the component of a x b along `axis`. a and b lie in a plane whose normal is not 0 along
 * it. */
static int cross_sign(const int64_t a[3], const int64_t b[3], int axis)
{
    const int x = (axis + 1) % 3, y = (axis + 2) % 3;
    const int64_t d = a[x] * b[y] - a[y] * b[x];
    return (d > 0) - (d < 0);
}

static bool sector_contains(const int64_t a[3], const int64_t b[3], const int64_t x[3], int axis)
{
    const int way = cross_sign(a, b, axis);
    return cross_sign(a, x, axis) * way >= 0 && cross_sign(x, b, axis) * way >= 0;
}

/* Do two sectors (cones spanned by a, b and by c, d, each of less than 180 degrees) have a common
 * ray? Solves s a + t b = u c + v d with s, t, u, v >= 0. */
static bool sectors_meet(const int64_t a[3], const int64_t b[3], const int64_t c[3],
                         const int64_t d[3])
{
    const int s = det_sign(b, c, d), t = -det_sign(a, c, d), u = -det_sign(a, b, d),
              v = det_sign(a, b, c);
    if (s || t || u || v)
        return (s >= 0 && t >= 0 && u >= 0 && v >= 0) || (s <= 0 && t <= 0 && u <= 0 && v <= 0);
    for (int axis = 0; axis < 3; axis++)
        if (cross_sign(a, b, axis) && cross_sign(c, d, axis))
            return sector_contains(a, b, c, axis) || sector_contains(a, b, d, axis) ||
                   sector_contains(c, d, a, axis) || sector_contains(c, d, b, axis);
    return true; // a degenerate sector
}

/* A ring of n points with integer coordinates that winds around the origin `rounds` times in random
 * steps, on a cone, a saddle or a rough surface; some rings step back. Even seeds are rotated. */
static void make_ring(uint64_t seed, size_t n, int rounds, int64_t (*ring)[3])
{
    const double rise = sdm_rng_normal(seed, 0, 0),
                 bend = seed % 3 ? 0 : sdm_rng_normal(seed, 0, 1);
    const double rough = seed % 4 ? 0 : 0.3 * sdm_rng_uniform(seed, 0, 2),
                 needles = seed % 5 ? 1 : 4;
    double q[4], r[9], sum = 0, angle = 0;
    for (uint64_t i = 0; i < 4; i++) q[i] = sdm_rng_normal(seed, 1, i);
    quaternion_rotation(q, r);
    if (seed % 2) memcpy(r, (const double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof r);
    for (size_t i = 0; i < n; i++) sum += pow(sdm_rng_uniform(seed, 2, i), needles);
    for (size_t i = 0; i < n; i++) {
        const double length = 1 + (seed % 7 < 3 ? 0 : -0.99) * sdm_rng_uniform(seed, 3, i);
        const double high = rise + bend * cos(2 * angle) + rough * sdm_rng_normal(seed, 4, i);
        const double unit = 0.99 * length * REACH / sqrt(1 + high * high);
        const double x[3] = {unit * cos(angle), unit * sin(angle), unit * high};
        for (int a = 0; a < 3; a++)
            ring[i][a] = llround(r[3 * a] * x[0] + r[3 * a + 1] * x[1] + r[3 * a + 2] * x[2]);
        const double back = seed % 4 == 1 && sdm_rng_uniform(seed, 5, i) < 0.03 ? -1 : 1;
        angle += back * 2 * PI * rounds * pow(sdm_rng_uniform(seed, 2, i), needles) / sum;
    }
}

static void mesh_fan(sdm_mesh *m, const int64_t (*ring)[3], size_t n, const double middle[3])
{
    mesh_make(m, n + 1, n);
    mesh_vertex(m, n, middle[0], middle[1], middle[2]);
    for (size_t i = 0; i < n; i++) {
        mesh_vertex(m, i, middle[0] + (double)ring[i][0], middle[1] + (double)ring[i][1],
                    middle[2] + (double)ring[i][2]);
        mesh_triangle(m, i, n, i, (i + 1) % n);
    }
}

static void test_meeting_triangles_are_visited(void **state)
{
    (void)state;
    enum { RING_MAX = 40 };
    size_t discs = 0, folded = 0;
    for (uint64_t seed = 0; seed < 4000; seed++) {
        int64_t ring[RING_MAX][3];
        const size_t n = 3 + sdm_rng_below(seed, 9, 0, RING_MAX - 3);
        const double far = seed % 6 ? 0 : 1e6, middle[3] = {far, -far, far};
        sdm_mesh m = {0};
        make_ring(seed, n, seed % 11 ? 1 : 2, ring);
        bool same = false;
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j < i; j++) same = same || !memcmp(ring[i], ring[j], sizeof ring[i]);
        if (same) continue;
        mesh_fan(&m, (const int64_t(*)[3])ring, n, middle);
        const size_t visits = visits_of(&m);
        bool meets = false;
        for (size_t i = 0; i < n; i++) {
            for (size_t j = i + 2; j < n && j - i < n - 1; j++)
                meets = meets || sectors_meet(ring[i], ring[i + 1], ring[j], ring[(j + 1) % n]);
            // neighbouring triangles overlap if they are coplanar and on the same side of their
            // common edge
            const int64_t *a = ring[(i + n - 1) % n], *b = ring[i], *c = ring[(i + 1) % n];
            for (int axis = 0; axis < 3 && !det_sign(a, b, c); axis++)
                meets = meets || cross_sign(a, b, axis) * cross_sign(b, c, axis) < 0;
        }
        if (visits == 0 && meets)
            fail_msg("seed %d: triangles that meet were not visited", (int)seed);
        if (visits != 0 && visits != n * (n - 1) / 2)
            fail_msg("seed %d: %zu visits, %zu triangles", (int)seed, visits, n);
        discs += visits == 0;
        folded += meets;
        sdm_mesh_dispose(&m);
    }
    assert_true(discs > 1500 && folded > 500);
}

/* Discs and saddles of up to 100000 needles around one vertex: no pair is visited, so the cost
 * stays linear. */
static void test_round_faces_need_no_visits(void **state)
{
    (void)state;
    for (size_t n = 100; n <= 100000; n *= 10) {
        for (int k = 0; k < 3; k++) {
            sdm_mesh m = {0};
            mesh_make(&m, n + 1, n);
            mesh_vertex(&m, n, 1, 2, k);
            for (size_t i = 0; i < n; i++) {
                const double angle = 2 * PI * (double)i / (double)n;
                mesh_vertex(&m, i, 1 + cos(angle), 2 + sin(angle), k ? 0.5 * cos(2 * angle) : 0);
                mesh_triangle(&m, i, n, i, (i + 1) % n);
            }
            assert_int_equal(visits_of(&m), 0);
            sdm_mesh_dispose(&m);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_meeting_triangles_are_visited),
                                       cmocka_unit_test(test_round_faces_need_no_visits)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
