/* Invariance of the exact engine: reordered triangles and vertices, duplicated vertices, scaling,
 * rotation and a distant origin must not change the distances. Usage: test_exact_motion [MESHES
 * [FIRST]]
 * Tests: exact.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_subject.h"

enum { POINTS = 30 };
static uint64_t n_meshes = 110, first, n_tips;

/* A similarity transform: x -> factor * r x + by. */
typedef struct motion {
    double factor, r[9], by[3];
} motion;

static motion motion_identity(void)
{
    return (motion){.factor = 1, .r = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

static void motion_apply(const motion *m, const double x[3], double y[3])
{
    rotate(m->r, x, y);
    for (int a = 0; a < 3; a++) y[a] = m->factor * y[a] + m->by[a];
}

static void motion_apply_to_mesh(const motion *to, const sdm_mesh *m, sdm_mesh *out)
{
    if (sdm_mesh_copy(m, out, NULL)) abort();
    for (size_t v = 0; v < m->n_vert; v++) motion_apply(to, &m->vert[3 * v], &out->vert[3 * v]);
}

/* Error bound at needle tips: how far the tip of the nearest triangle of the union moves when
 * one of its sides moves by union_error_mm. It is large for needles, which may even appear or
 * vanish. */
static double tip_error(const sdm_exact *e, const double x[3])
{
    uint32_t t;
    (void)sdm_exact_point(e, x, NULL, NULL, &t);
    const sdm_mesh *m = sdm_exact_surface(e);
    const point a = corner_of(m, 3 * (size_t)t), b = corner_of(m, 3 * (size_t)t + 1),
                c = corner_of(m, 3 * (size_t)t + 2);
    const real longest = fmaxl(distance(a, b), fmaxl(distance(b, c), distance(c, a)));
    const real height = length(cross(minus(b, a), minus(c, a))) / longest;
    return (double)(sdm_exact_get_report(e)->union_error_mm * longest / height);
}

static size_t distinct_vertices(const sdm_mesh *m)
{
    size_t n = 0;
    for (size_t i = 0; i < m->n_vert; i++) {
        size_t j = 0;
        while (j < i && memcmp(&m->vert[3 * i], &m->vert[3 * j], 3 * sizeof *m->vert)) j++;
        n += j == i;
    }
    return n;
}

/* `moved` must be the mesh of *s transformed by `to`: all distances scale with to->factor, to
 * within `roundings` units of rounding in both frames. */
static void compare_with(subject *s, const sdm_mesh *moved, const motion *to,
                         const sdm_exact_opts *opts, double roundings)
{
    sdm_exact *here = engine_of(s, &s->mesh, opts), *there = engine_of(s, moved, opts);
    double lo[3], hi[3];
    const double largest = mesh_bounds(moved, lo, hi);
    const double seams = sdm_exact_get_report(here)->union_error_mm * to->factor +
                         sdm_exact_get_report(there)->union_error_mm;
    const bool closed = sdm_exact_get_report(here)->audit.closed;
    // rounding may merge vertices that are very close; then a closed mesh may become open
    const bool welded = distinct_vertices(&s->mesh) != distinct_vertices(moved);
    if (!welded) assert_int_equal(closed, sdm_exact_get_report(there)->audit.closed);
    // if the volume is within rounding of 0, inside and outside are interchangeable
    const sdm_audit *audit = &sdm_exact_get_report(here)->audit;
    const bool sided = fabs(audit->volume) > 64 * DBL_EPSILON * audit->area * s->largest;
    // Whether touching parts intersect depends on rounding, and an inside-out part is reversed only
    // if it intersects no other part: compare only if equally many parts were reversed.
    const bool same =
        sdm_exact_get_report(here)->parts_turned == sdm_exact_get_report(there)->parts_turned;
    for (int k = 0; k < POINTS && sided && same && !welded; k++) {
        double x[3], y[3], reach = largest;
        random_point(&s->mesh, &s->dice, x);
        motion_apply(to, x, y);
        for (int a = 0; a < 3; a++) reach = fmax(reach, fabs(y[a]));
        const double d = to->factor * sdm_exact_point(here, x, NULL, NULL, NULL),
                     e = sdm_exact_point(there, y, NULL, NULL, NULL);
        const double tolerance =
            roundings * (to->factor * rounding_at(s, x) + DBL_EPSILON * reach) + seams;
        const double off = fabs(fabs(d) - fabs(e)) - tolerance;
        const bool tip = off > 0 && off <= (fabs(d) < fabs(e) ? to->factor * tip_error(here, x)
                                                              : tip_error(there, y));
        CHECK(tip || off <= 0, s, x, "%.17g, %.17g after a motion", d, e);
        n_tips += tip;
        // near a sheet, buried ones included, rounding may move the point to the other side
        const double clear = to->factor * (double)brute_distance(&s->mesh, x);
        const bool even = !closed && fabsl(brute_winding(&s->mesh, point_of(x)) - 0.5L) < 1e-6L;
        if (!even && clear > (closed ? tolerance : tolerance + open_margin * s->size * to->factor))
            CHECK((d < 0) == (e < 0), s, x, "%.17g, %.17g after a motion", d, e);
    }
    sdm_exact_free(here);
    sdm_exact_free(there);
}

/* compare_with() for the transformed mesh of *s. */
static void compare_moved(subject *s, const motion *to, const sdm_exact_opts *opts)
{
    sdm_mesh other = {0};
    motion_apply_to_mesh(to, &s->mesh, &other);
    compare_with(s, &other, to, opts, bound);
    sdm_mesh_dispose(&other);
}

static void test_order_of_triangles_and_vertices(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        sdm_mesh other = {0};
        const motion rest = motion_identity();
        motion_apply_to_mesh(&rest, &s.mesh, &other);
        mesh_shuffle(&other, &s.dice);
        compare_with(&s, &other, &rest, NULL, bound);
        // separate vertices for each triangle, in reverse order
        mesh_make(&other, 3 * s.mesh.n_tri, s.mesh.n_tri);
        for (size_t c = 0; c < 3 * s.mesh.n_tri; c++) {
            const double *v = &s.mesh.vert[3 * (size_t)s.mesh.tri[c]];
            mesh_vertex(&other, 3 * s.mesh.n_tri - 1 - c, v[0], v[1], v[2]);
            other.tri[c] = (uint32_t)(3 * s.mesh.n_tri - 1 - c);
        }
        compare_with(&s, &other, &rest, NULL, bound);
        sdm_mesh_dispose(&other);
        subject_dispose(&s);
    }
}

/* Scaling by powers of two changes only exponents: the results must scale bit by bit. */
static void test_powers_of_two_scale_bit_by_bit(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        bool exact;
        const sdm_grid g = random_grid(&s, &exact);
        float *v = map_of(&s, s.engine, &g);
        double x[3];
        random_point(&s.mesh, &s.dice, x);
        const double d = sdm_exact_point(s.engine, x, NULL, NULL, NULL);
        for (int exponent = -30; exponent <= 30; exponent += 20) {
            sdm_mesh other = {0};
            motion to = motion_identity();
            to.factor = ldexp(1, exponent);
            motion_apply_to_mesh(&to, &s.mesh, &other);
            sdm_exact *e = engine_of(&s, &other, NULL);
            sdm_grid h = g;
            double y[3];
            for (int a = 0; a < 3; a++) {
                h.spacing[a] *= to.factor;
                h.origin[a] *= to.factor;
                y[a] = x[a] * to.factor;
            }
            float *w = map_of(&s, e, &h);
            for (size_t k = 0; k < sdm_grid_count(&g); k++)
                CHECK(w[k] == ldexpf(v[k], exponent), &s, x,
                      "voxel %zu, scale 2^%d: %.9g, need %.9g", k, exponent, (double)w[k],
                      (double)ldexpf(v[k], exponent));
            const double scaled = sdm_exact_point(e, y, NULL, NULL, NULL);
            CHECK(scaled == ldexp(d, exponent), &s, x, "scale 2^%d: %.17g, need %.17g", exponent,
                  scaled, ldexp(d, exponent));
            free(w);
            sdm_exact_free(e);
            sdm_mesh_dispose(&other);
        }
        free(v);
        subject_dispose(&s);
    }
}

static void test_scales(void **state)
{
    (void)state;
    static const double factors[] = {1e-9, 3.7e-4, 1.1, 1e9};
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        motion to = motion_identity();
        to.factor = factors[i / RANDOM_FAMILIES % 4];
        compare_moved(&s, &to, NULL);
        subject_dispose(&s);
    }
}

/* Rotations round the vertices: coincident sheets may intersect afterwards, but the distances
 * change by no more than the rounding. */
static void test_rotations(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        motion to = motion_identity();
        rotation(&s.dice, to.r);
        for (int a = 0; a < 3; a++) to.by[a] = roll(&s.dice, -3, 3) * s.size;
        compare_moved(&s, &to, NULL);
        subject_dispose(&s);
    }
}

/* At a distance of 10^6 times the mesh size, thin parts vanish from the union by rounding: compare
 * with keep_overlap. */
static void test_far_origin(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        motion to = motion_identity();
        for (int a = 0; a < 3; a++) to.by[a] = roll(&s.dice, -1e6, 1e6) * s.size;
        compare_moved(&s, &to, &(sdm_exact_opts){.keep_overlap = true});
        subject_dispose(&s);
    }
}

int main(int argc, char **argv)
{
    subject_range(argc, argv, &n_meshes, &first);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_order_of_triangles_and_vertices),
        cmocka_unit_test(test_powers_of_two_scale_bit_by_bit),
        cmocka_unit_test(test_scales),
        cmocka_unit_test(test_rotations),
        cmocka_unit_test(test_far_origin),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    print_message("%u points at tips of needles, which are uncertain\n", (unsigned)n_tips);
    return failed;
}
