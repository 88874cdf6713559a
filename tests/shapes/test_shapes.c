/* The built-in shapes with closed forms: volumes, areas and distances of meshes against known
 * values, velocities against differences, and the cochlea against its definition.
 * Tests: builtin.c capsule.c cochlea.c cochlea_curve.c cochlea_distance.c cochlea_ring.c
 * ellipsoid.c lathe.c torus.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "shape_tools.h"

#define PI 3.14159265358979323846

static void default_params(const sdm_instance *s, double *p)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(s, &n);
    for (size_t i = 0; i < n; i++) p[i] = params[i].def;
}

static sdm_audit audit_closed(const sdm_mesh *m)
{
    sdm_audit a;
    sdm_error err = {0};
    if (sdm_mesh_audit(m, &a, &err)) fail_msg("%s", err.text);
    assert_true(a.closed);
    assert_true(a.manifold);
    assert_false(a.inverted);
    assert_int_equal(a.components, 1);
    assert_int_equal(a.degenerate, 0);
    assert_int_equal(a.duplicate, 0);
    return a;
}

/* Compares volume and area of two meshes, the second with edges twice as long, with the closed
 * forms. Meshes are inscribed: the relative error is positive and of order edge^2. */
static void size_check(const char *shape, const char *fine, const char *coarse, const double *p,
                       double volume, double area)
{
    double error[2];
    for (int i = 0; i < 2; i++) {
        sdm_instance *s = shape_make(shape, i ? coarse : fine);
        sdm_mesh m = {0};
        mesh_at(s, p, &m);
        const sdm_audit a = audit_closed(&m);
        assert_int_equal(a.self_intersections, 0);
        error[i] = 1 - a.volume / volume;
        assert_true(error[i] > 0 && error[i] < (i ? 0.02 : 0.006));
        if (area > 0) assert_true(1 - a.area / area > 0 && 1 - a.area / area < (i ? 0.012 : 0.004));
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
    // Edges twice as long: four times the error.
    assert_true(error[1] / error[0] > 3 && error[1] / error[0] < 5);
}

static void test_volumes_and_areas(void **state)
{
    (void)state;
    const double torus[] = {3.2, 0.9}, capsule[] = {1.3, 4.4}, ball[] = {2.5, 2.5, 2.5},
                 egg[] = {3.5, 2.8, 2.2};
    size_check("torus", "edge=0.1", "edge=0.2", torus, 2 * PI * PI * 3.2 * 0.81,
               4 * PI * PI * 3.2 * 0.9);
    size_check("capsule", "edge=0.1", "edge=0.2", capsule,
               PI * 1.69 * 4.4 + 4 * PI / 3 * 1.3 * 1.69, 2 * PI * 1.3 * 4.4 + 4 * PI * 1.69);
    size_check("ellipsoid", "edge=0.15", "edge=0.3", ball, 4 * PI / 3 * 2.5 * 2.5 * 2.5,
               4 * PI * 6.25);
    size_check("ellipsoid", "edge=0.15", "edge=0.3", egg, 4 * PI / 3 * 3.5 * 2.8 * 2.2, 0);
}

static double beta_function(double x, double y)
{
    return exp(lgamma(x) + lgamma(y) - lgamma(x + y));
}

static void test_superquadric_volume(void **state)
{
    (void)state;
    static const double E[][2] = {{0.5, 0.5}, {0.6, 1.4}, {1.7, 0.8}, {1, 1}, {2, 2}};
    for (size_t i = 0; i < sizeof E / sizeof *E; i++) {
        char options[64];
        snprintf(options, sizeof options, "edge=0.1 e1=%g e2=%g", E[i][0], E[i][1]);
        sdm_instance *s = shape_make("ellipsoid", options);
        const double p[3] = {4, 3, 2};
        sdm_mesh m = {0};
        mesh_at(s, p, &m);
        const double exact = 2 * p[0] * p[1] * p[2] * E[i][0] * E[i][1] *
                             beta_function(E[i][0] / 2 + 1, E[i][0]) *
                             beta_function(E[i][1] / 2, E[i][1] / 2);
        assert_true(fabs(audit_closed(&m).volume / exact - 1) < 0.006);
        for (size_t v = 0; v < m.n_vert; v++) {
            const double *x = m.vert + 3 * v, e1 = E[i][0], e2 = E[i][1];
            const double level =
                pow(pow(fabs(x[0]) / 4, 2 / e2) + pow(fabs(x[1]) / 3, 2 / e2), e2 / e1) +
                pow(fabs(x[2]) / 2, 2 / e1);
            assert_true(fabs(level - 1) < 1e-9);
        }
        double d;
        sdm_error err = {0};
        const double origin[3] = {0};
        if (E[i][0] != 1) {
            assert_int_equal(sdm_instance_distance(s, p, origin, &d, &err), SDM_E_UNSUPPORTED);
            assert_non_null(
                strstr(err.text, "shape 'ellipsoid' at rx=4 ry=3 rz=2: there is no closed form"));
        }
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
}

// Vertices lie on the surface according to the closed form, at random parameters.
static void test_vertices_on_surface(void **state)
{
    (void)state;
    static const char *const NAMES[] = {"ellipsoid", "torus", "capsule"};
    for (size_t k = 0; k < 3; k++) {
        sdm_instance *s = shape_make(NAMES[k], "");
        sdm_mesh m = {0};
        for (int i = 0; i < 20; i++) {
            double p[3];
            random_params(s, p);
            mesh_at(s, p, &m);
            audit_closed(&m);
            for (size_t v = 0; v < m.n_vert; v++)
                assert_true(fabs(distance_at(s, p, m.vert + 3 * v)) < 1e-12);
        }
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
}

// Unsigned distance from x to an ellipsoid with semi-axes r: the minimum over a grid of surface
// points, refined eight times around the nearest point.
static double sampled_distance(const double r[3], const double x[3])
{
    double lo[2] = {-PI / 2, 0}, hi[2] = {PI / 2, 2 * PI}, best = INFINITY, at[2] = {0, 0};
    for (int round = 0; round < 8; round++) {
        for (int i = 0; i <= 80; i++)
            for (int j = 0; j <= 80; j++) {
                const double u = lo[0] + (hi[0] - lo[0]) * i / 80,
                             v = lo[1] + (hi[1] - lo[1]) * j / 80;
                const double y[3] = {r[0] * cos(u) * cos(v), r[1] * cos(u) * sin(v), r[2] * sin(u)};
                const double d =
                    sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) +
                         (x[2] - y[2]) * (x[2] - y[2]));
                if (d < best) best = d, at[0] = u, at[1] = v;
            }
        for (int k = 0; k < 2; k++) {
            const double half = (hi[k] - lo[k]) / 8;
            lo[k] = at[k] - half, hi[k] = at[k] + half;
        }
    }
    return best;
}

static void test_ellipsoid_distance(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("ellipsoid", "");
    double p[3];
    for (int i = 0; i < 60; i++) {
        random_params(s, p);
        if (i % 4 == 1) p[1] = p[0] < 4 ? p[0] : (p[0] = 4); // an ellipsoid of revolution
        if (i % 4 == 2) p[0] = p[1] = p[2] = 2.5;            // a ball
        double x[3];
        for (int k = 0; k < 3; k++) x[k] = random_in(-5, 5) * (i % 3 ? 1 : 0.2);
        if (i % 5 == 1) x[i % 3] = 0;
        if (i % 10 == 3) x[0] = x[1] = x[2] = 0;
        if (i % 10 == 8) x[i % 3] = x[(i + 1) % 3] = 0;
        const double sampled = sampled_distance(p, x), d = distance_at(s, p, x);
        const double level =
            x[0] * x[0] / (p[0] * p[0]) + x[1] * x[1] / (p[1] * p[1]) + x[2] * x[2] / (p[2] * p[2]);
        assert_true(level < 1 ? d < 0 : d >= 0);
        assert_true(fabs(d) <= sampled + 1e-12); // no sample may be nearer than the distance ...
        assert_true(fabs(d) >= sampled - 1e-7);  // ... and the nearest sample comes close to it
    }
    // Far away, and close to the plane of the two longest axes.
    const double egg[3] = {5, 3, 1}, far[3] = {3e6, 0, 0}, flat[3] = {0.5, 0, 1e-300},
                 on[3] = {0, 0, 1};
    assert_true(fabs(distance_at(s, egg, far) - (3e6 - 5)) < 1e-6);
    const double flat0[3] = {0.5, 0, 0};
    assert_true(fabs(distance_at(s, egg, flat) - distance_at(s, egg, flat0)) < 1e-12);
    assert_true(fabs(distance_at(s, egg, on)) < 1e-15);
    sdm_instance_free(s);
}

static void test_velocities_match_differences(void **state)
{
    (void)state;
    velocity_check("torus", "edge=0.5", 4, 1e-9);
    velocity_check("capsule", "edge=0.5", 4, 1e-9);
    velocity_check("ellipsoid", "edge=0.6 e1=0.7 e2=1.3", 4, 1e-9);
    velocity_check("cochlea", "", 12, 1e-6);
    velocity_check("cochlea", "ear=left start=cubic section=ellipse", 8, 1e-6);
    velocity_check("cochlea", "free=anatomy", 8, 1e-6);
    velocity_check("cochlea", "free=anatomy ear=left start=cubic section=ellipse", 8, 2e-5);
}

/* Sectors of the cochlea's mesh (pole, rings, pole): the number of triangles at vertex 0. */
static size_t count_sectors(const sdm_mesh *m)
{
    size_t n = 0;
    for (size_t i = 0; i < 3 * m->n_tri; i++) n += m->tri[i] == 0;
    return n;
}

static void ring_centre(const sdm_mesh *m, size_t ring, double c[3])
{
    const size_t n = count_sectors(m);
    c[0] = c[1] = c[2] = 0;
    for (size_t j = 0; j < n; j++)
        for (size_t k = 0; k < 3; k++) c[k] += m->vert[3 * (1 + ring * n + j) + k] / (double)n;
}

typedef struct edges {
    double sum, squares, n;
} edges;

static void add_edges(const sdm_mesh *m, edges *e)
{
    // Each edge of a closed mesh is visited twice.
    for (size_t i = 0; i < m->n_tri; i++)
        for (size_t a = 0; a < 3; a++) {
            const double *x = m->vert + 3 * m->tri[3 * i + a],
                         *y = m->vert + 3 * m->tri[3 * i + (a + 1) % 3];
            const double d2 = (x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) +
                              (x[2] - y[2]) * (x[2] - y[2]);
            e->sum += sqrt(d2), e->squares += d2, e->n++;
        }
}

static void test_cochlea_mesh_is_regular(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("cochlea", "");
    double p[4];
    sdm_mesh m = {0};
    edges all = {0}, one = {0};
    default_params(s, p);
    mesh_at(s, p, &m);
    audit_closed(&m);
    assert_int_equal(m.n_tri, 3420);
    add_edges(&m, &one);
    assert_true(fabs(one.sum / one.n - 0.364) < 0.005);
    for (int i = 0; i < 40; i++) {
        random_params(s, p);
        mesh_at(s, p, &m);
        assert_int_equal(m.n_tri, 3420); // the number of triangles does not depend on parameters
        audit_closed(&m);
        add_edges(&m, &all);
    }
    const double mean = all.sum / all.n, deviation = sqrt(all.squares / all.n - mean * mean);
    assert_true(mean > 0.30 && mean < 0.37);
    assert_true(deviation < 0.15);

    // Half the edge length gives four times the triangles.
    sdm_instance *fine = shape_make("cochlea", "edge=0.15");
    mesh_at(fine, p, &m);
    assert_in_range(m.n_tri, 3420 * 36 / 10, 3420 * 44 / 10);
    sdm_mesh_dispose(&m);
    sdm_instance_free(fine);
    sdm_instance_free(s);
}

static void extent(const char *options, const double *p, double size[3])
{
    sdm_instance *s = shape_make("cochlea", options);
    sdm_mesh m = {0};
    mesh_at(s, p, &m);
    const sdm_audit a = audit_closed(&m);
    for (int k = 0; k < 3; k++) size[k] = a.max[k] - a.min[k];
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

static void test_cochlea_bounding_boxes(void **state)
{
    (void)state;
    // Extreme parameters, which exceed the box stated in the paper: with flare=0 (no widening at
    // the basal end) the cochlea measures 11.4 x 10.7 x 5.1 mm.
    const double large[4] = {5, 0, 0.05, 0}, nominal[4] = {4.4, 0.5, 0.145, 0.4};
    double size[3];
    extent("flare=0 edge=0.1", large, size);
    assert_true(fabs(size[0] - 11.4) < 0.1 && fabs(size[1] - 10.7) < 0.1 &&
                fabs(size[2] - 5.1) < 0.3);
    // Real cochleas: 9.2 x 6.8 x 4 to 4.5 mm at the inner wall, along the axis through the
    // apex.
    extent("", nominal, size);
    assert_true(fabs(size[0] - 9.6) < 0.1 && fabs(size[1] - 7.9) < 0.1 &&
                fabs(size[2] - 4.6) < 0.1);
}

static void test_cochlea_vertices_on_tube(void **state)
{
    (void)state;
    // With flare=0 the tube's radius changes by only 0.02 mm per radian, so the union of balls
    // along the centreline equals the tube up to a few micrometres.
    sdm_instance *s = shape_make("cochlea", "flare=0");
    sdm_mesh m = {0};
    for (int i = 0; i < 12; i++) {
        double p[4];
        random_params(s, p);
        mesh_at(s, p, &m);
        size_t on = 0;
        for (size_t v = 0; v < m.n_vert; v++) {
            const double d = distance_at(s, p, m.vert + 3 * v);
            assert_true(d < 1e-9);
            on += d > -4e-3;
        }
        // the other vertices are inside, where the tube overlaps itself
        assert_true(on > m.n_vert * 55 / 100);
        assert_true(fabs(distance_at(s, p, m.vert)) < 1e-5);
        assert_true(fabs(distance_at(s, p, m.vert + 3 * (m.n_vert - 1))) < 2e-5);
    }
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

// The distance of the cochlea against the minimum over a very fine walk along its centreline.
static void test_cochlea_distance_matches_search(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("cochlea", "");
    for (int i = 0; i < 30; i++) {
        double p[4], x[3] = {random_in(-6, 7), random_in(-6, 6), random_in(-3, 6)}, best = INFINITY;
        random_params(s, p);
        for (int k = 0; k <= 200000; k++) {
            const double t = 14.5 * k / 200000, r = p[0] * exp(-p[2] * t),
                         z = 0.2 * t + p[1] * exp(-0.3 * t) * cos(t - p[3]);
            const double dx = x[0] - r * cos(t), dy = x[1] - r * sin(t), dz = x[2] - z;
            best = fmin(best, sqrt(dx * dx + dy * dy + dz * dz) -
                                  (1.11 - 0.02 * t + 0.25 * exp(-t / 0.35)));
        }
        const double d = distance_at(s, p, x);
        assert_true(d <= best + 1e-12 && d > best - 1e-8);
    }
    sdm_instance_free(s);
}

// Winding number of the mesh about x (van Oosterom and Strackee 1983).
static int winding(const sdm_mesh *m, const double x[3])
{
    double sum = 0;
    for (size_t i = 0; i < m->n_tri; i++) {
        double v[3][3], l[3], dot[3];
        for (size_t a = 0; a < 3; a++) {
            for (size_t k = 0; k < 3; k++) v[a][k] = m->vert[3 * m->tri[3 * i + a] + k] - x[k];
            l[a] = sqrt(v[a][0] * v[a][0] + v[a][1] * v[a][1] + v[a][2] * v[a][2]);
        }
        for (size_t a = 0; a < 3; a++) {
            const size_t b = (a + 1) % 3;
            dot[a] = v[a][0] * v[b][0] + v[a][1] * v[b][1] + v[a][2] * v[b][2];
        }
        const double det = v[0][0] * (v[1][1] * v[2][2] - v[1][2] * v[2][1]) -
                           v[0][1] * (v[1][0] * v[2][2] - v[1][2] * v[2][0]) +
                           v[0][2] * (v[1][0] * v[2][1] - v[1][1] * v[2][0]);
        sum += 2 * atan2(det, l[0] * l[1] * l[2] + dot[0] * l[2] + dot[1] * l[0] + dot[2] * l[1]);
    }
    return (int)lrint(sum / (4 * PI));
}

static void test_cochlea_encloses_its_tube(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("cochlea", "");
    sdm_mesh m = {0};
    // Points (last three numbers) deep inside near the apex; a mesh whose sections ran backwards
    // there would have holes.
    static const double HOLES[][7] = {{2.605, 1.121, 0.237, -0.390, -0.060, 0.628, 1.967},
                                      {2.248, 0.801, 0.245, 0.273, 0.517, 0.471, 1.827},
                                      {2.527, 0.211, 0.239, 0.178, -0.662, 0.214, 2.324},
                                      {3.915, 0.172, 0.184, 0.077, -0.316, 0.056, 2.071},
                                      {2.134, 0.802, 0.243, 0.339, 0.226, 0.685, 1.982}};
    for (size_t i = 0; i < sizeof HOLES / sizeof *HOLES; i++) {
        mesh_at(s, HOLES[i], &m);
        assert_true(distance_at(s, HOLES[i], HOLES[i] + 4) < -0.25);
        assert_true(winding(&m, HOLES[i] + 4) >= 1);
    }
    // Random points, except near the tube's wall: winding number >= 1 inside of the union of balls,
    // 0 outside.
    for (int i = 0; i < 12; i++) {
        double p[4];
        random_params(s, p);
        if (i % 2) p[0] = random_in(2, 3), p[2] = random_in(0.15, 0.25);
        mesh_at(s, p, &m);
        for (int k = 0; k < 150; k++) {
            const double x[3] = {random_in(-2, 2), random_in(-2, 2), random_in(-1.5, 5)};
            const double d = distance_at(s, p, x);
            const int w = winding(&m, x);
            if (d < -0.1) assert_true(w >= 1);
            if (d > 1e-6) assert_int_equal(w, 0);
        }
    }
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

static void test_cochlea_ears_are_mirrored(void **state)
{
    (void)state;
    sdm_instance *right = shape_make("cochlea", "ear=right"),
                 *left = shape_make("cochlea", "ear=left");
    double p[4];
    random_params(right, p);
    sdm_mesh r = {0}, l = {0};
    mesh_at(right, p, &r);
    mesh_at(left, p, &l);
    assert_int_equal(r.n_vert, l.n_vert);
    for (size_t v = 0; v < r.n_vert; v++) {
        assert_true(r.vert[3 * v] == l.vert[3 * v] && r.vert[3 * v + 1] == -l.vert[3 * v + 1]);
        assert_true(r.vert[3 * v + 2] == l.vert[3 * v + 2]);
    }
    assert_true(fabs(audit_closed(&r).volume - audit_closed(&l).volume) <
                1e-9); // the mirrored mesh is not inside out
    const double x[3] = {1, 2, 0.5}, y[3] = {1, -2, 0.5};
    assert_true(distance_at(right, p, x) == distance_at(left, p, y));
    sdm_mesh_dispose(&r);
    sdm_mesh_dispose(&l);
    sdm_instance_free(right);
    sdm_instance_free(left);
}

// Distance from the point of radius `radius` on the centreline at theta = 0 to the nearest ring
// centre.
static double start_error(const char *options, double radius)
{
    sdm_instance *s = shape_make("cochlea", options);
    double p[4], best = INFINITY;
    default_params(s, p);
    sdm_mesh m = {0};
    mesh_at(s, p, &m);
    for (size_t i = 0; i < 12; i++) {
        double c[3];
        ring_centre(&m, i, c);
        best = fmin(best, hypot(hypot(c[0] - radius, c[1]), c[2] - 0.5 * cos(0.4)));
    }
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
    return best;
}

static void test_cochlea_start_of_centreline(void **state)
{
    (void)state;
    assert_true(start_error("", 4.4) < 1e-12);
    assert_true(start_error("start=cubic", 5.3) < 1e-12);
    assert_true(start_error("start=cubic p0=6", 6) < 1e-12);
    assert_true(start_error("start=cubic", 4.4) > 0.1);

    // Beyond theta2 both forms of the start have the same centreline, so apical distances are
    // equal.
    sdm_instance *a = shape_make("cochlea", "theta=14.5"),
                 *b = shape_make("cochlea", "start=cubic theta2=1");
    const double p[4] = {4, 0.3, 0.1, 0};
    const double x[3] = {-2, -1, 3};
    assert_true(distance_at(a, p, x) == distance_at(b, p, x));
    sdm_instance_free(a);
    sdm_instance_free(b);
}

static double point_distance(const double *x, const double *y)
{
    return sqrt((x[0] - y[0]) * (x[0] - y[0]) + (x[1] - y[1]) * (x[1] - y[1]) +
                (x[2] - y[2]) * (x[2] - y[2]));
}

// axes: largest and smallest distance of a ring's vertices from its centre.
static void ring_axes(const sdm_mesh *m, size_t ring, double axes[2])
{
    const size_t n = count_sectors(m);
    double c[3];
    ring_centre(m, ring, c);
    axes[0] = 0, axes[1] = INFINITY;
    for (size_t j = 0; j < n; j++) {
        const double d = point_distance(m->vert + 3 * (1 + ring * n + j), c);
        axes[0] = fmax(axes[0], d), axes[1] = fmin(axes[1], d);
    }
}

static void test_cochlea_elliptic_section(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("cochlea", "section=ellipse ratio=0.6 edge=0.1");
    double p[4], axes[2];
    default_params(s, p);
    sdm_mesh m = {0};
    mesh_at(s, p, &m);
    audit_closed(&m);
    const size_t n_rings = (m.n_vert - 2) / count_sectors(&m);

    // The ring at theta = 0 is the widest of the first 40.
    size_t first = 0;
    double widest = 0;
    for (size_t i = 0; i < 40; i++) {
        ring_axes(&m, i, axes);
        if (axes[0] > widest) widest = axes[0], first = i;
    }
    ring_axes(&m, first, axes);
    assert_true(fabs(axes[0] - 1.36) < 0.01 && fabs(axes[1] / axes[0] - 0.6) < 0.01);
    // Beyond the first turn sections are round.
    ring_axes(&m, n_rings * 65 / 100, axes);
    assert_true(fabs(axes[1] / axes[0] - 1) < 1e-9);
    sdm_mesh_dispose(&m);
    sdm_instance_free(s);
}

// With free=anatomy, options become parameters of the same names and with the same effect.
static void test_cochlea_anatomy_parameters(void **state)
{
    (void)state;
    static const char *const NAMES[] = {"a",     "alpha", "b",      "phi", "c",
                                        "kappa", "theta", "theta2", "p0"};
    static const struct {
        const char *options;
        size_t n;
    } CASES[] = {{"", 4}, {"start=cubic", 4}, {"free=anatomy", 7}, {"free=anatomy start=cubic", 9}};
    for (size_t i = 0; i < 4; i++) {
        sdm_instance *s = shape_make("cochlea", CASES[i].options);
        size_t n;
        const sdm_param *params = sdm_instance_params(s, &n);
        assert_int_equal(n, CASES[i].n);
        for (size_t k = 0; k < n; k++) assert_string_equal(params[k].name, NAMES[k]);
        sdm_instance_free(s);
    }

    sdm_instance *s = shape_make("cochlea", "free=anatomy start=cubic c=0.17 p0=5");
    double p[9];
    default_params(s, p);
    assert_true(p[4] == 0.17 && p[5] == 0.3 && p[6] == 14.5 && p[8] == 5);
    sdm_mesh m = {0}, fixed_mesh = {0};
    sdm_instance *fixed = shape_make("cochlea", "start=cubic c=0.17 p0=5");
    mesh_at(s, p, &m);
    mesh_at(fixed, p, &fixed_mesh);
    assert_int_equal(m.n_vert, fixed_mesh.n_vert);
    assert_memory_equal(m.vert, fixed_mesh.vert, 3 * m.n_vert * sizeof *m.vert);
    sdm_instance_free(fixed);
    for (int i = 0; i < 8; i++) {
        char options[200];
        random_params(s, p);
        snprintf(options, sizeof options,
                 "start=cubic c=%.17g kappa=%.17g theta=%.17g theta2=%.17g p0=%.17g", p[4], p[5],
                 p[6], p[7], p[8]);
        fixed = shape_make("cochlea", options);
        mesh_at(s, p, &m);
        (void)audit_closed(&m);
        for (int k = 0; k < 60; k++) {
            const double x[3] = {random_in(-6, 7), random_in(-6, 6), random_in(-2, 6)};
            const double d = distance_at(fixed, p, x);
            assert_true(fabs(distance_at(s, p, x) - d) < 1e-12);
            const int w = winding(&m, x);
            if (d < -0.15) assert_true(w >= 1);
            if (d > 1e-6) assert_int_equal(w, 0);
        }
        sdm_instance_free(fixed);
    }
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&fixed_mesh);
    sdm_instance_free(s);
}

static void shape_refused(const char *options, const char *reason)
{
    sdm_named_text given[4];
    size_t n = 0;
    char text[200];
    snprintf(text, sizeof text, "%s", options);
    for (char *word = strtok(text, " "); word; word = strtok(NULL, " "), n++) {
        given[n].name = word;
        given[n].value = strchr(word, '=') + 1;
        *strchr(word, '=') = 0;
    }
    sdm_instance *s = NULL;
    sdm_error err = {0};
    assert_int_equal(
        sdm_instance_create(sdm_registry_find(registry, "cochlea", NULL), given, n, NULL, &s, &err),
        SDM_E_PLUGIN);
    assert_null(s);
    if (!strstr(err.text, reason)) fail_msg("%s", err.text);
}

static void test_bad_cochlea_options_are_refused(void **state)
{
    (void)state;
    const sdm_named_text thin[] = {{"taper", "0.1"}};
    sdm_instance *s = NULL;
    sdm_error err = {0};
    const sdm_shape *cochlea = sdm_registry_find(registry, "cochlea", NULL);
    assert_int_equal(sdm_instance_create(cochlea, thin, 1, NULL, &s, &err), SDM_E_PLUGIN);
    assert_null(s);
    assert_non_null(strstr(err.text, "shape 'cochlea': tube radius -0.34 mm at the apex"));
    shape_refused("c=0.5 free=anatomy",
                  "c = 0.5, but with free = anatomy it is a parameter: need 0.14 to 0.26");
    // Refused because of the largest angle in the range, although the default angle would be valid.
    shape_refused("taper=0.07 free=anatomy", "tube radius -0.059 mm at the apex");

    s = shape_make("cochlea", "section=ellipse");
    double p[4], d;
    const double x[3] = {0};
    default_params(s, p);
    assert_int_equal(sdm_instance_distance(s, p, x, &d, &err), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(
        err.text, "shape 'cochlea' at a=4.4 alpha=0.5 b=0.145 phi=0.4: there is no closed form"));
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_volumes_and_areas),
        cmocka_unit_test(test_superquadric_volume),
        cmocka_unit_test(test_vertices_on_surface),
        cmocka_unit_test(test_ellipsoid_distance),
        cmocka_unit_test(test_velocities_match_differences),
        cmocka_unit_test(test_cochlea_mesh_is_regular),
        cmocka_unit_test(test_cochlea_bounding_boxes),
        cmocka_unit_test(test_cochlea_vertices_on_tube),
        cmocka_unit_test(test_cochlea_distance_matches_search),
        cmocka_unit_test(test_cochlea_encloses_its_tube),
        cmocka_unit_test(test_cochlea_ears_are_mirrored),
        cmocka_unit_test(test_cochlea_start_of_centreline),
        cmocka_unit_test(test_cochlea_elliptic_section),
        cmocka_unit_test(test_cochlea_anatomy_parameters),
        cmocka_unit_test(test_bad_cochlea_options_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
