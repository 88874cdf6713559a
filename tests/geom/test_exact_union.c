/* Meshes that overlap themselves: distances of the exact engine compared with closed forms of
 * unions, a swept sphere, and dense samples of the boundary; source triangles of the union and
 * memory limits.
 * Tests: contact.c cutting.c grid_scratch.c parts.c surface_side.c union_hull.c vertex_table.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/exact_tools.h"
#include "sdm/exact.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"

static const double pi = 3.14159265358979323846;

static double uniform(uint64_t stream, uint64_t i, double lo, double hi)
{
    return lo + (hi - lo) * sdm_rng_uniform(11, stream, i);
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* Signed distance to the union of two spheres of radii r0 and r1, centred at 0 and c on the x
 * axis. */
static double two_spheres_distance(const double x[3], double r0, double c, double r1)
{
    const double middle[2][3] = {{0, 0, 0}, {c, 0, 0}}, radius[2] = {r0, r1};
    const double d[2] = {distance(x, middle[0]) - r0, distance(x, middle[1]) - r1};
    if (d[0] > 0 && d[1] > 0) return fmin(d[0], d[1]);
    // inside: the nearest boundary point is on an outer cap, or on the circle where the spheres
    // intersect
    const double cx = (c * c + r0 * r0 - r1 * r1) / (2 * c), cr = sqrt(r0 * r0 - cx * cx);
    double best = hypot(x[0] - cx, hypot(x[1], x[2]) - cr);
    for (int i = 0; i < 2; i++) {
        const double len = distance(x, middle[i]);
        double foot[3];
        for (int a = 0; a < 3; a++)
            foot[a] = middle[i][a] + (x[a] - middle[i][a]) * radius[i] / len;
        if (distance(foot, middle[1 - i]) >= radius[1 - i])
            best = fmin(best, fabs(radius[i] - len));
    }
    return -best;
}

static void test_two_spheres_match_closed_form(void **state)
{
    (void)state;
    const size_t n = 48;
    for (int round = 0; round < 4; round++) {
        const double c = (double[]){1.0, 1.3, 0.7, 1.6}[round],
                     r1 = (double[]){1.0, 0.8, 0.6, 1.1}[round];
        sdm_mesh m = {0}, b = {0};
        mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, n);
        mesh_sphere(&b, (const double[3]){c, 0, 0}, r1, n + 3);
        mesh_append(&m, &b);
        sdm_exact *e = engine(&m, NULL);
        const sdm_exact_report *r = sdm_exact_get_report(e);
        assert_true(r->unioned && r->union_error_mm > 0 && r->union_error_mm < 1e-12 &&
                    r->audit.self_intersections > 20);
        // The facets deviate from the spheres by at most the sagitta; the circle of intersection
        // moves by the sagitta divided by the sine of the angle between the spheres.
        const double sagitta = 2.2 * 1.1 * (1 - cos(pi / 2 / (double)n));
        const double cosine = (1 + r1 * r1 - c * c) / (2 * r1), sine = sqrt(1 - cosine * cosine);
        for (uint64_t i = 0; i < 4000; i++) {
            double x[3], q[3];
            uint32_t t;
            for (uint64_t a = 0; a < 3; a++)
                x[a] = uniform((uint64_t)round, 3 * i + a, -1.5, 1.5) + (a == 0 ? c / 2 : 0);
            const double d = sdm_exact_point(e, x, q, NULL, &t),
                         truth = two_spheres_distance(x, 1, c, r1);
            assert_true(fabs(d - truth) <= 2 * sagitta / sine);
            assert_true(t < sdm_exact_surface(e)->n_tri);
            // the nearest point q is not inside the union
            assert_true(two_spheres_distance(q, 1, c, r1) > -2 * sagitta / sine);
        }
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
        sdm_mesh_dispose(&b);
    }
}

/* An axis-parallel box from corner lo to corner hi. union_of_boxes_distance() gives the distance to
 * the union by brute force: to all parts of the faces that are not inside the union. Faces shared
 * by two boxes count as inside. */
typedef struct box {
    double lo[3], hi[3];
} box;

static double union_of_boxes_distance(const double x[3], const box *b, int n)
{
    bool in = false;
    double best = INFINITY;
    for (int i = 0; i < n; i++) {
        bool all = true;
        for (int a = 0; a < 3; a++) all = all && x[a] > b[i].lo[a] && x[a] < b[i].hi[a];
        in = in || all;
    }
    // the coordinates of all boxes divide each face into rectangles, each of which lies entirely
    // inside the union or on its boundary
    for (int i = 0; i < n; i++) {
        for (int f = 0; f < 6; f++) {
            const int a = f / 2, u = (a + 1) % 3, v = (a + 2) % 3;
            const double at = f % 2 ? b[i].hi[a] : b[i].lo[a];
            double cut[2][16];
            int count[2] = {0, 0};
            for (int s = 0; s < 2; s++) {
                const int k = s ? v : u;
                for (int j = 0; j < n; j++) {
                    cut[s][count[s]++] = fmin(fmax(b[j].lo[k], b[i].lo[k]), b[i].hi[k]);
                    cut[s][count[s]++] = fmin(fmax(b[j].hi[k], b[i].lo[k]), b[i].hi[k]);
                }
                for (int p = 0; p < count[s]; p++)
                    for (int q = p + 1; q < count[s]; q++)
                        if (cut[s][q] < cut[s][p]) {
                            const double swap = cut[s][p];
                            cut[s][p] = cut[s][q];
                            cut[s][q] = swap;
                        }
            }
            for (int p = 0; p + 1 < count[0]; p++) {
                for (int q = 0; q + 1 < count[1]; q++) {
                    if (!(cut[0][p + 1] > cut[0][p]) || !(cut[1][q + 1] > cut[1][q])) continue;
                    const double mu = 0.5 * (cut[0][p] + cut[0][p + 1]),
                                 mv = 0.5 * (cut[1][q] + cut[1][q + 1]);
                    // on the boundary unless both sides are in some box
                    bool side[2] = {false, false};
                    for (int j = 0; j < n; j++) {
                        if (!(mu > b[j].lo[u] && mu < b[j].hi[u] && mv > b[j].lo[v] &&
                              mv < b[j].hi[v]))
                            continue;
                        side[0] = side[0] || (at > b[j].lo[a] && at <= b[j].hi[a]);
                        side[1] = side[1] || (at >= b[j].lo[a] && at < b[j].hi[a]);
                    }
                    if (side[0] && side[1]) continue;
                    const double du = fmax(fmax(cut[0][p] - x[u], x[u] - cut[0][p + 1]), 0);
                    const double dv = fmax(fmax(cut[1][q] - x[v], x[v] - cut[1][q + 1]), 0);
                    best = fmin(best, sqrt(du * du + dv * dv + (x[a] - at) * (x[a] - at)));
                }
            }
        }
    }
    return in ? -best : best;
}

static void check_boxes(const box *b, int n, uint64_t stream, int unioned)
{
    sdm_mesh m = {0}, part = {0};
    for (int i = 0; i < n; i++) {
        mesh_box(&part, b[i].lo, b[i].hi);
        mesh_append(&m, &part);
    }
    sdm_exact *e = engine(&m, NULL);
    if (unioned >= 0) assert_int_equal(sdm_exact_get_report(e)->unioned, unioned);
    for (uint64_t i = 0; i < 600; i++) {
        double x[3];
        for (uint64_t a = 0; a < 3; a++) x[a] = uniform(stream, 3 * i + a, -0.7, 3.2);
        const double d = sdm_exact_point(e, x, NULL, NULL, NULL),
                     truth = union_of_boxes_distance(x, b, n);
        if (!(fabs(d - truth) < 1e-12))
            fail_msg("stream %u: %.17g at %g %g %g, need %.17g", (unsigned)stream, d, x[0], x[1],
                     x[2], truth);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&part);
}

static void test_boxes_with_coplanar_faces(void **state)
{
    (void)state;
    // in this order: overlap with coplanar faces, a shared face, faces that touch in part, a box
    // within a box, the same with two coplanar faces, two equal boxes, a shared edge, two boxes
    // apart
    check_boxes((const box[]){{{0, 0, 0}, {1, 1, 1}}, {{0.5, 0, 0}, {1.5, 1, 1}}}, 2, 1, true);
    check_boxes((const box[]){{{0, 0, 0}, {1, 1, 1}}, {{1, 0, 0}, {2, 1, 1}}}, 2, 2, true);
    check_boxes((const box[]){{{0, 0, 0}, {1, 1, 1}}, {{1, 0.25, 0.3}, {2, 0.75, 0.6}}}, 2, 3,
                true);
    check_boxes((const box[]){{{0, 0, 0}, {2, 2, 2}}, {{0.5, 0.5, 0.5}, {1, 1, 1}}}, 2, 4, true);
    check_boxes((const box[]){{{0, 0, 0}, {2, 2, 2}}, {{0, 0.5, 0.5}, {1, 1, 2}}}, 2, 5, true);
    check_boxes((const box[]){{{0, 0, 0}, {1, 1, 1}}, {{0, 0, 0}, {1, 1, 1}}}, 2, 6, true);
    check_boxes((const box[]){{{0, 0, 0}, {1, 1, 1}}, {{1, 1, 0}, {2, 2, 1}}}, 2, 7, false);
    check_boxes((const box[]){{{0, 0, 0}, {1, 1, 1}}, {{2, 0, 0}, {3, 1, 1}}}, 2, 8, false);
}

static void test_random_boxes(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 40; round++) {
        box b[4];
        for (uint64_t i = 0; i < 4; i++) {
            for (uint64_t a = 0; a < 3; a++) {
                // coordinates on a coarse lattice (odd rounds): faces often coincide
                const double lattice = round % 2 ? 0.5 : 1e-3;
                b[i].lo[a] = floor(uniform(900 + round, 8 * i + a, 0, 1.99) / lattice) * lattice;
                b[i].hi[a] =
                    b[i].lo[a] + lattice +
                    floor(uniform(900 + round, 8 * i + 4 + a, 0, 0.99) / lattice) * lattice;
            }
        }
        check_boxes(b, 4, 2000 + round, -1);
    }
}

static void test_spiral_against_swept_sphere(void **state)
{
    (void)state;
    for (int round = 0; round < 3; round++) {
        const spiral s = (spiral[]){{4.4, 0.06, 0.5, 0.4, 9, 0},
                                    {2.2, 0.05, 0.2, -0.7, 13, 0},
                                    {2.2, 0.02, 0.0, 0.0, 14.5, 0}}[round];
        const double edge = 0.15;
        sdm_mesh m = {0};
        mesh_spiral(&m, &s, edge);
        sdm_exact *e = engine(&m, NULL);
        const sdm_exact_report *r = sdm_exact_get_report(e);
        assert_true(r->audit.closed && r->audit.manifold && r->unioned &&
                    r->union_error_mm < 1e-11);
        // Largest deviation: chords around the tube, chords along it on the outer side of the
        // narrowest turn, and 0.001 because the normal section of a tube whose radius shrinks by
        // 0.02 per radian is not exactly the section of the swept sphere.
        const double bend = edge / (s.a * exp(-s.b * s.end)), around = edge;
        const double bound = 1.1 * (1 - cos(around / 2)) + 2.2 * bend * bend / 8 * 1.5 + 0.001;
        for (uint64_t i = 0; i < 300; i++) {
            double x[3];
            for (uint64_t a = 0; a < 3; a++)
                x[a] = uniform(50 + (uint64_t)round, 3 * i + a, -6, 6) + (a == 2 ? 2 : 0);
            const double d = sdm_exact_point(e, x, NULL, NULL, NULL),
                         swept = spiral_distance(&s, x);
            if (swept > 0) assert_true(fabs(d - swept) < bound);
            if (swept < -bound) assert_true(d < 0);
            // where turns overlap, the swept sphere gives only a lower bound on the depth
            if (swept < -bound) assert_true(d < swept + bound);
        }
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

/* Samples points on every triangle and keeps those on the boundary of the union: the point just
 * outside has a positive distance, the point just inside a negative one. points: [returned
 * number][3], caller frees. */
static size_t boundary_samples(const sdm_mesh *m, size_t n, double **points)
{
    *points = malloc(3 * sizeof(double) * m->n_tri * n * n);
    if (!*points) abort();
    size_t count = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const double *v[3];
        double ab[3], ac[3], normal[3];
        for (size_t k = 0; k < 3; k++) v[k] = &m->vert[3 * (size_t)m->tri[3 * t + k]];
        for (int a = 0; a < 3; a++) {
            ab[a] = v[1][a] - v[0][a];
            ac[a] = v[2][a] - v[0][a];
        }
        for (int a = 0; a < 3; a++)
            normal[a] = ab[(a + 1) % 3] * ac[(a + 2) % 3] - ab[(a + 2) % 3] * ac[(a + 1) % 3];
        const double len =
            sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
        for (size_t i = 0; i < n; i++) {
            for (size_t j = 0; j + i < n; j++) {
                double *p = *points + 3 * count, off[3], in[3];
                for (int a = 0; a < 3; a++) {
                    p[a] = v[0][a] + ((double)i + 1.0 / 3) / (double)n * ab[a] +
                           ((double)j + 1.0 / 3) / (double)n * ac[a];
                    off[a] = p[a] + 1e-9 * normal[a] / len;
                    in[a] = p[a] - 1e-9 * normal[a] / len;
                }
                count += sdm_naive_point(m, off) > 0 && sdm_naive_point(m, in) < 0;
            }
        }
    }
    return count;
}

static void test_spiral_against_boundary_samples(void **state)
{
    (void)state;
    const spiral s = {2.0, 0.2, 0.6, 0.3, 9, 0.25};
    sdm_mesh m = {0};
    mesh_spiral(&m, &s, 0.6);
    sdm_exact *e = engine(&m, NULL), *plain = engine(&m, &(sdm_exact_opts){.keep_overlap = true});
    assert_false(sdm_exact_get_report(plain)->unioned);
    double *points, longest = 0;
    const size_t n = 8, count = boundary_samples(&m, n, &points);
    for (size_t i = 0; i < 3 * m.n_tri; i++)
        longest = fmax(
            longest, distance(&m.vert[3 * m.tri[i]], &m.vert[3 * m.tri[i / 3 * 3 + (i + 1) % 3]]));
    int deeper = 0;
    for (uint64_t i = 0; i < 500; i++) {
        double x[3], best = INFINITY;
        for (uint64_t a = 0; a < 3; a++) x[a] = uniform(70, 3 * i + a, -3, 3) + (a == 2 ? 1 : 0);
        for (size_t p = 0; p < count; p++) best = fmin(best, distance(x, points + 3 * p));
        const double d = sdm_exact_point(e, x, NULL, NULL, NULL),
                     o = sdm_exact_point(plain, x, NULL, NULL, NULL);
        assert_true(fabs(d) <= best + 1e-8 && fabs(d) >= best - 1.2 * longest / (double)n);
        assert_true((d < 0) == (sdm_naive_point(&m, x) < 0) && (d < 0) == (o < 0));
        // outside of the solid, buried surface does not affect the distance
        if (d > 0) assert_true(fabs(d - o) < 1e-12);
        deeper += d < o - 1e-6;
    }
    assert_true(deeper > 5);
    free(points);
    sdm_exact_free(e);
    sdm_exact_free(plain);
    sdm_mesh_dispose(&m);
}

/* Random closed meshes with many self-intersections: spheres with randomly displaced vertices. */
static void test_displaced_spheres_against_boundary_samples(void **state)
{
    (void)state;
    for (uint64_t round = 0; round < 12; round++) {
        sdm_mesh m = {0};
        mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 5);
        for (size_t i = 0; i < 3 * m.n_vert; i++) m.vert[i] += uniform(80 + round, i, -0.4, 0.4);
        sdm_exact *e = engine(&m, NULL);
        const sdm_exact_report *r = sdm_exact_get_report(e);
        assert_true(r->sign == SDM_SIGN_CROSSINGS);
        double *points;
        const size_t count = boundary_samples(&m, 24, &points);
        for (uint64_t i = 0; i < 150; i++) {
            double x[3], best = INFINITY;
            for (uint64_t a = 0; a < 3; a++) x[a] = uniform(100 + round, 3 * i + a, -1.5, 1.5);
            for (size_t p = 0; p < count; p++) best = fmin(best, distance(x, points + 3 * p));
            const double d = sdm_exact_point(e, x, NULL, NULL, NULL);
            assert_true((d < 0) == ((sdm_naive_point(&m, x) < 0) != r->turned));
            if (!r->turned) assert_true(fabs(d) <= best + 1e-8 && fabs(d) >= best - 0.12);
        }
        free(points);
        sdm_exact_free(e);
        sdm_mesh_dispose(&m);
    }
}

/* n = twice the area vector of the triangle a b c; returns its length. */
static double area_vector(const double a[3], const double b[3], const double c[3], double n[3])
{
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] = (b[j] - a[j]) * (c[k] - a[k]) - (b[k] - a[k]) * (c[j] - a[j]);
    }
    return sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

/* Every triangle of the engine's surface must lie within its source triangle of the mesh and keep
 * its orientation; without a union both surfaces are the same. */
static void check_source(const sdm_mesh *m, const sdm_exact_opts *o)
{
    sdm_exact *e = engine(m, o);
    const sdm_mesh *surface = sdm_exact_surface(e);
    const uint32_t *source = sdm_exact_source(e);
    for (size_t t = 0; t < surface->n_tri; t++) {
        assert_true(source[t] < m->n_tri);
        if (!sdm_exact_get_report(e)->unioned) assert_int_equal(source[t], t);
        double v[3][3], part[3][3], normal[3], n[3];
        for (size_t k = 0; k < 3; k++) {
            memcpy(v[k], &m->vert[3 * (size_t)m->tri[3 * (size_t)source[t] + k]], sizeof v[k]);
            memcpy(part[k], &surface->vert[3 * (size_t)surface->tri[3 * t + k]], sizeof part[k]);
        }
        const double area = area_vector(v[0], v[1], v[2], normal),
                     size = area_vector(part[0], part[1], part[2], n);
        const double turned = sdm_exact_get_report(e)->turned ? -1 : 1;
        assert_true(size > 0 && size <= area * (1 + 1e-9));
        assert_true(turned * (n[0] * normal[0] + n[1] * normal[1] + n[2] * normal[2]) > 0);
        for (size_t k = 0; k < 3; k++) {
            // barycentric coordinates of the vertex in its source triangle: not negative, and they
            // reproduce the vertex
            double sum[3] = {0, 0, 0};
            for (size_t i = 0; i < 3; i++) {
                const double a = area_vector(part[k], v[(i + 1) % 3], v[(i + 2) % 3], n);
                const double share = (n[0] * normal[0] + n[1] * normal[1] + n[2] * normal[2]) < 0
                                         ? -a / area
                                         : a / area;
                assert_true(share > -1e-9);
                for (int c = 0; c < 3; c++) sum[c] += share * v[i][c];
            }
            assert_true(distance(sum, part[k]) < 1e-9);
        }
    }
    sdm_exact_free(e);
}

static void test_source_triangles(void **state)
{
    (void)state;
    const spiral s = {2.0, 0.2, 0.6, 0.3, 9, 0.25};
    sdm_mesh m = {0}, b = {0};
    mesh_spiral(&m, &s, 0.6);
    check_source(&m, NULL);
    check_source(&m, &(sdm_exact_opts){.keep_overlap = true});
    mesh_flip(&m);
    check_source(&m, NULL);
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 9);
    check_source(&m, NULL);
    mesh_sphere(&b, (const double[3]){0.7, 0.1, 0.2}, 1, 13);
    mesh_append(&m, &b);
    check_source(&m, NULL);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

/* A bipyramid over a pentagram: the triangles around an apex wind around it twice and intersect,
 * although neighbours along the fan are consistently oriented. */
static void test_fan_that_winds_twice(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_make(&m, 7, 10);
    for (size_t i = 0; i < 5; i++)
        mesh_vertex(&m, i, cos(4 * pi * (double)i / 5), sin(4 * pi * (double)i / 5), 0);
    mesh_vertex(&m, 5, 0, 0, 1);
    mesh_vertex(&m, 6, 0, 0, -1);
    for (size_t i = 0; i < 5; i++) {
        mesh_triangle(&m, i, i, (i + 1) % 5, 5);
        mesh_triangle(&m, 5 + i, (i + 1) % 5, i, 6);
    }
    sdm_exact *e = engine(&m, NULL);
    assert_true(sdm_exact_get_report(e)->unioned &&
                sdm_exact_get_report(e)->sign == SDM_SIGN_CROSSINGS);
    // the union's section at z = 0 is the outline of the star; its notches are nearest to the
    // centre
    double q[3];
    const double notch = cos(2 * pi / 5) / cos(pi / 5);
    const double d = sdm_exact_point(e, (const double[3]){0, 0, 0}, q, NULL, NULL);
    // expected: distance of the centre from the concave edge between a notch (radius `notch`) and
    // an apex
    assert_true(fabs(d + notch / sqrt(1 + notch * notch)) < 1e-12);
    for (size_t i = 0; i < 3 * sdm_exact_surface(e)->n_vert; i += 3) {
        const double *v = &sdm_exact_surface(e)->vert[i];
        assert_true(fabs(v[2]) > 1e-9 || sqrt(v[0] * v[0] + v[1] * v[1]) > notch - 1e-9);
    }
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

/* For every memory_limit the engine is either created or fails with a message that names the limit;
 * the smallest sufficient limit is of the size of the memory in use. */
static void test_smallest_memory_limit(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 12);
    for (int i = 0; i < 6; i++) {
        mesh_sphere(&b, (const double[3]){0.01 * i, 0.02 * i, -0.013 * i}, 1, 12);
        mesh_append(&m, &b);
    }
    size_t limit = 10000;
    int refused = 0;
    for (;; limit += limit / 16) {
        sdm_exact *e = NULL;
        sdm_error err = {0};
        const sdm_status s =
            sdm_exact_create(&m, &(sdm_exact_opts){.memory_limit = limit}, &e, &err);
        sdm_exact_free(e);
        if (!s) break;
        char text[32];
        (void)snprintf(text, sizeof text, "memory_limit is %zu", limit);
        assert_int_equal(s, SDM_E_NOMEM);
        assert_null(e);
        assert_non_null(strstr(err.text, text));
        refused++;
    }
    assert_true(refused > 20);
    // bytes per triangle: more than for meshes without overlap, but bounded
    assert_true(limit > 500 * m.n_tri && limit < 8000 * m.n_tri);
    mesh_sphere(&b, (const double[3]){0, 0, 0}, 1, 100);
    sdm_exact *e = NULL;
    assert_int_equal(
        sdm_exact_create(&b, &(sdm_exact_opts){.memory_limit = 1600 * b.n_tri}, &e, NULL), SDM_OK);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

/* memory_limit covers the engine and the certificate together: a certificate that would fit alone
 * is refused if the engine already takes most of the limit. */
static void test_memory_limit_is_shared(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_box(&m, (const double[3]){-1, -1, -1}, (const double[3]){1, 1, 1});
    sdm_exact *e = NULL;
    size_t limit = 1000;
    while (sdm_exact_create(&m, &(sdm_exact_opts){.memory_limit = limit}, &e, NULL))
        limit += limit / 16;
    sdm_exact_free(e);
    // the certificate takes two bits per voxel, in groups of 16 voxels along x; the mesh is far
    // from the grid, so there are no crossings to store
    int64_t n = 16;
    while ((size_t)(n + 1) * (size_t)(n + 1) * ((size_t)n / 16 + 1) * 4 < limit) n++;
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){n, n, n}, 0.1, (const double[3]){100, 100, 100});
    float *v = malloc(sdm_grid_count(&g) * sizeof *v);
    assert_non_null(v);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) v[i] = 1;
    for (size_t k = 1; k <= 4; k += 3) {
        sdm_sign_certificate c;
        sdm_error err = {0};
        const sdm_exact_opts o = {.memory_limit = k * limit, .n_threads = 1};
        assert_int_equal(sdm_exact_create(&m, &o, &e, &err), SDM_OK);
        assert_int_equal(sdm_exact_sign(e, &g, v, &err), SDM_OK);
        assert_int_equal(sdm_exact_certify(e, &g, v, &c, &err), k == 1 ? SDM_E_NOMEM : SDM_OK);
        if (k == 1) assert_non_null(strstr(err.text, "the certificate needs"));
        sdm_exact_free(e);
    }
    free(v);
    sdm_mesh_dispose(&m);
}

/* Both triangles that intersect compute the vertices on their line of intersection: these must be
 * merged to one vertex each. */
static void test_intersection_vertices_are_merged(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 16);
    mesh_sphere(&b, (const double[3]){0.71, 0.23, -0.17}, 1, 16);
    mesh_append(&m, &b);
    sdm_exact *e = NULL;
    assert_int_equal(sdm_exact_create(&m, NULL, &e, NULL), SDM_OK);
    assert_true(sdm_exact_get_report(e)->unioned);
    const sdm_mesh *s = sdm_exact_surface(e);
    size_t twice = 0;
    for (size_t i = 0; i < s->n_vert; i++) {
        for (size_t k = 0; k < i; k++) {
            double d = 0;
            for (size_t a = 0; a < 3; a++)
                d = fmax(d, fabs(s->vert[3 * i + a] - s->vert[3 * k + a]));
            twice += d < 1e-14;
        }
    }
    assert_int_equal(twice, 0);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

/* With a memory_limit the engine's arrays are allocated one by one, without one they share a single
 * block: both give the same bits, and every allocation may fail. */
static void test_separate_and_shared_allocation_agree(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 24);
    mesh_sphere(&b, (const double[3]){0.7, 0.2, -0.1}, 1, 24);
    mesh_append(&m, &b);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[3]){20, 20, 20}, 0.15, (const double[3]){0.3, 0, 0});
    static float values[2][8000];
    unsigned long n = 1;
    for (;; n++) {
        sdm_exact *e = NULL;
        sdm_error err = {0};
        sdm_alloc_fail_after(n);
        const sdm_status s =
            sdm_exact_create(&m, &(sdm_exact_opts){.memory_limit = (size_t)1 << 40}, &e, &err);
        sdm_alloc_fail_after(0);
        if (!s) assert_int_equal(sdm_exact_map(e, &g, values[0], &err), SDM_OK);
        sdm_exact_free(e);
        if (!s) break;
        assert_int_equal(s, SDM_E_NOMEM);
        assert_true(err.text[0] != 0);
    }
    assert_true(n > 30);
    sdm_exact *e = NULL;
    assert_int_equal(sdm_exact_create(&m, NULL, &e, NULL), SDM_OK);
    assert_int_equal(sdm_exact_map(e, &g, values[1], NULL), SDM_OK);
    assert_memory_equal(values[0], values[1], sizeof values[0]);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_two_spheres_match_closed_form),
        cmocka_unit_test(test_boxes_with_coplanar_faces),
        cmocka_unit_test(test_random_boxes),
        cmocka_unit_test(test_spiral_against_swept_sphere),
        cmocka_unit_test(test_spiral_against_boundary_samples),
        cmocka_unit_test(test_displaced_spheres_against_boundary_samples),
        cmocka_unit_test(test_source_triangles),
        cmocka_unit_test(test_fan_that_winds_twice),
        cmocka_unit_test(test_smallest_memory_limit),
        cmocka_unit_test(test_separate_and_shared_allocation_agree),
        cmocka_unit_test(test_intersection_vertices_are_merged),
        cmocka_unit_test(test_memory_limit_is_shared),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
