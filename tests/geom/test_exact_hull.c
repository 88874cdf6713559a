/* Unions of overlapping random meshes. Two properties prove each distance: the nearest point found
 * is on the boundary of the union (the set of points with winding number >= 1), and no boundary
 * point is nearer. Usage: test_exact_hull [MESHES [FIRST]]
 * Tests: bvh.c contact.c crossings.c cutting.c facet.c feature_build.c line_triangle.c nearest.c
 * parts.c point_triangle.c predicates.c surface_side.c topology.c union_hull.c
 * vertex_table.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_subject.h"

enum { POINTS = 6, SAMPLES = 3 };
static uint64_t n_meshes = 440, first;

typedef enum boundary_state { BOUNDARY_NO, BOUNDARY_YES, BOUNDARY_UNSURE } boundary_state;

/* Is p, a point of a face with unit normal n, on the boundary of the union? Tests whether the
 * points p - step n and p + step n lie on different sides (inside/outside). BOUNDARY_UNSURE if
 * another part of the surface is nearer than about `step` to one of them. */
static boundary_state boundary_test(const subject *s, point p, point n, real step)
{
    bool inside[2];
    for (int side = 0; side < 2; side++) {
        const real way = side ? -step : step;
        const point y = {p.x + way * n.x, p.y + way * n.y, p.z + way * n.z};
        const double x[3] = {(double)y.x, (double)y.y, (double)y.z};
        if (brute_distance(&s->mesh, x) < 0.9L * step) return BOUNDARY_UNSURE;
        inside[side] = truly_inside(s, point_of(x));
    }
    return inside[0] != inside[1] ? BOUNDARY_YES : BOUNDARY_NO;
}

static bool unit_normal(point a, point b, point c, point *n)
{
    const point ab = minus(b, a), ac = minus(c, a);
    *n = cross(ab, ac);
    const real len = length(*n), least = 1e-6L * fmaxl(dot(ab, ab), dot(ac, ac));
    if (!(len > least)) return false;
    *n = (point){n->x / len, n->y / len, n->z / len};
    return true;
}

static point inner_point(point a, point b, point c, double s, double t)
{
    return (point){a.x + s * (b.x - a.x) + t * (c.x - a.x), a.y + s * (b.y - a.y) + t * (c.y - a.y),
                   a.z + s * (b.z - a.z) + t * (c.z - a.z)};
}

static size_t n_boundary, n_buried;

/* Fails if a point of the input mesh that is nearer to x than abs(d) lies on the boundary of the
 * union. Samples SAMPLES points on each triangle that comes near enough. */
static void check_no_boundary_point_nearer(subject *s, const double x[3], double d)
{
    for (size_t t = 0; t < s->mesh.n_tri; t++) {
        const point a = corner_of(&s->mesh, 3 * t), b = corner_of(&s->mesh, 3 * t + 1),
                    c = corner_of(&s->mesh, 3 * t + 2);
        const point q = closest_on_triangle(point_of(x), a, b, c);
        point n;
        if (distance(point_of(x), q) > fabs(d) - 1e-8 * s->size || !unit_normal(a, b, c, &n))
            continue;
        for (int k = 0; k < SAMPLES; k++) {
            // a random point between q, the nearest point of the triangle, and a random point of it
            const double u = roll(&s->dice, 0, 1), v = roll(&s->dice, 0, 1 - u);
            const point p = towards(q, inner_point(a, b, c, u, v), roll(&s->dice, 0.001, 1));
            if (distance(point_of(x), p) > fabs(d) - 1e-8 * s->size) continue;
            const boundary_state found = boundary_test(s, p, n, 1e-11L * s->size);
            CHECK(found != BOUNDARY_YES, s, x, "%.17g, but triangle %zu bounds the solid at %.17Lg",
                  d, t, distance(point_of(x), p));
            n_buried += found == BOUNDARY_NO;
        }
    }
}

static void check_nearest_is_on_boundary(subject *s, const double x[3], double d, uint32_t t)
{
    const sdm_mesh *used = sdm_exact_surface(s->engine);
    const point a = corner_of(used, 3 * (size_t)t), b = corner_of(used, 3 * (size_t)t + 1),
                c = corner_of(used, 3 * (size_t)t + 2);
    point n;
    if (!unit_normal(a, b, c, &n)) return;
    // several step lengths: a step that is longer than a neighbouring wedge is thick crosses both
    // of its faces and finds no change of side
    int yes = 0, no = 0;
    for (int k = 0; k < SAMPLES; k++) {
        const double u = roll(&s->dice, 0, 1), v = roll(&s->dice, 0, 1 - u);
        for (real step = 1e-11L; step > 0.5e-13L; step /= 10) {
            const boundary_state found =
                boundary_test(s, inner_point(a, b, c, u, v), n, step * s->size);
            yes += found == BOUNDARY_YES;
            no += found == BOUNDARY_NO;
        }
    }
    CHECK(yes || !no, s, x, "%.17g, but its nearest triangle %u does not bound the solid", d,
          (unsigned)t);
    n_boundary += (size_t)yes;
}

static void test_nearest_point_is_nearest_boundary_point(void **state)
{
    (void)state;
    n_boundary = n_buried = 0;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        if (random_families[i % RANDOM_FAMILIES].kind != SURFACE_OVERLAP &&
            random_families[i % RANDOM_FAMILIES].kind != SURFACE_CANCELS)
            continue;
        subject s;
        subject_make(&s, i, NULL);
        for (int k = 0; k < POINTS && s.report->unioned; k++) {
            double x[3], lo[3], hi[3];
            uint32_t t;
            if (k % 2) {
                random_point(&s.mesh, &s.dice, x);
            } else {
                (void)mesh_bounds(&s.mesh, lo, hi);
                for (int a = 0; a < 3; a++) x[a] = roll(&s.dice, lo[a], hi[a]);
            }
            const double d = sdm_exact_point(s.engine, x, NULL, NULL, &t);
            check_no_boundary_point_nearer(&s, x, d);
            check_nearest_is_on_boundary(&s, x, d, t);
        }
        subject_dispose(&s);
    }
    print_message("%zu places on the boundary, %zu buried ones\n", n_boundary, n_buried);
    if (n_meshes >= 100) assert_true(n_boundary > n_meshes && n_buried > n_meshes);
}

int main(int argc, char **argv)
{
    subject_range(argc, argv, &n_meshes, &first);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_nearest_point_is_nearest_boundary_point),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
