/* What must not change the exact engine's answer: order of triangles and corners, repeated
 * vertices, scale, rotation, a far origin. test_exact_motion [MESHES [FIRST]]
 * Tests: exact.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_subject.h"

enum { POINTS = 30 };
static uint64_t n_meshes = 110, first, n_tips;

/* A place the mesh is brought to: x -> factor * r x + by. */
typedef struct motion {
    double factor, r[9], by[3];
} motion;

static motion at_rest(void) { return (motion){.factor = 1, .r = {1, 0, 0, 0, 1, 0, 0, 0, 1}}; }

static void move(const motion *m, const double x[3], double y[3])
{
    rotate(m->r, x, y);
    for (int a = 0; a < 3; a++) y[a] = m->factor * y[a] + m->by[a];
}

static void move_mesh(const motion *to, const sdm_mesh *m, sdm_mesh *out)
{
    if (sdm_mesh_copy(m, out, NULL)) abort();
    for (size_t v = 0; v < m->n_vert; v++) move(to, &m->vert[3 * v], &out->vert[3 * v]);
}

/* How far the tip of the nearest piece of the union moves when a side of it moves by the union's
   error: far for needles, which may also be there or not. */
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

/* The moved mesh has the moved distances, to `roundings` of the coordinates here and there. */
static void compare(subject *s, const sdm_mesh *moved, const motion *to, const sdm_exact_opts *opts,
                    double roundings)
{
    sdm_exact *here = engine_of(s, &s->mesh, opts), *there = engine_of(s, moved, opts);
    double lo[3], hi[3];
    const double largest = mesh_bounds(moved, lo, hi);
    const double seams = sdm_exact_get_report(here)->union_error_mm * to->factor +
                         sdm_exact_get_report(there)->union_error_mm;
    const bool closed = sdm_exact_get_report(here)->audit.closed;
    // vertices nearer to each other than the rounding of where they are moved to become one: what
    // was closed may open
    const bool welded = distinct_vertices(&s->mesh) != distinct_vertices(moved);
    if (!welded) assert_int_equal(closed, sdm_exact_get_report(there)->audit.closed);
    // a volume that is rounding has no sign: which side is called inside is chance
    const sdm_audit *audit = &sdm_exact_get_report(here)->audit;
    const bool sided = fabs(audit->volume) > 64 * DBL_EPSILON * audit->area * s->largest;
    // parts that touch each other meet or not by chance of rounding, and only those that do not are
    // turned
    const bool same =
        sdm_exact_get_report(here)->parts_turned == sdm_exact_get_report(there)->parts_turned;
    for (int k = 0; k < POINTS && sided && same && !welded; k++) {
        double x[3], y[3], reach = largest;
        random_point(&s->mesh, &s->dice, x);
        move(to, x, y);
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
        // near buried sheets, too, the sign is that of some place within rounding
        const double clear = to->factor * (double)brute_distance(&s->mesh, x);
        const bool even = !closed && fabsl(brute_winding(&s->mesh, point_of(x)) - 0.5L) < 1e-6L;
        if (!even && clear > (closed ? tolerance : tolerance + open_margin * s->size * to->factor))
            CHECK((d < 0) == (e < 0), s, x, "%.17g, %.17g after a motion", d, e);
    }
    sdm_exact_free(here);
    sdm_exact_free(there);
}

/* compare() with the mesh of *s moved. */
static void compare_moved(subject *s, const motion *to, const sdm_exact_opts *opts)
{
    sdm_mesh other = {0};
    move_mesh(to, &s->mesh, &other);
    compare(s, &other, to, opts, bound);
    sdm_mesh_dispose(&other);
}

static void test_order(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        sdm_mesh other = {0};
        const motion rest = at_rest();
        move_mesh(&rest, &s.mesh, &other);
        mesh_shuffle(&other, &s.dice);
        compare(&s, &other, &rest, NULL, bound);
        // every triangle with its own vertices, in another order
        mesh_make(&other, 3 * s.mesh.n_tri, s.mesh.n_tri);
        for (size_t c = 0; c < 3 * s.mesh.n_tri; c++) {
            const double *v = &s.mesh.vert[3 * (size_t)s.mesh.tri[c]];
            mesh_vertex(&other, 3 * s.mesh.n_tri - 1 - c, v[0], v[1], v[2]);
            other.tri[c] = (uint32_t)(3 * s.mesh.n_tri - 1 - c);
        }
        compare(&s, &other, &rest, NULL, bound);
        sdm_mesh_dispose(&other);
        subject_dispose(&s);
    }
}

/* Powers of two change the exponent of every number and no digit. */
static void test_powers_of_two(void **state)
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
            motion to = at_rest();
            to.factor = ldexp(1, exponent);
            move_mesh(&to, &s.mesh, &other);
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
        motion to = at_rest();
        to.factor = factors[i / RANDOM_FAMILIES % 4];
        compare_moved(&s, &to, NULL);
        subject_dispose(&s);
    }
}

/* Rounding moves the vertices: sheets that lay on each other may cross then, but no distance
 * changes by more. */
static void test_rotations(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        motion to = at_rest();
        rotation(&s.dice, to.r);
        for (int a = 0; a < 3; a++) to.by[a] = roll(&s.dice, -3, 3) * s.size;
        compare_moved(&s, &to, NULL);
        subject_dispose(&s);
    }
}

/* At 10^6 times its size from the origin parts of the mesh are thinner than rounding and vanish
 * from the union: all surface. */
static void test_far_origin(void **state)
{
    (void)state;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, NULL);
        motion to = at_rest();
        for (int a = 0; a < 3; a++) to.by[a] = roll(&s.dice, -1e6, 1e6) * s.size;
        compare_moved(&s, &to, &(sdm_exact_opts){.keep_overlap = true});
        subject_dispose(&s);
    }
}

int main(int argc, char **argv)
{
    subject_range(argc, argv, &n_meshes, &first);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_order),      cmocka_unit_test(test_powers_of_two),
        cmocka_unit_test(test_scales),     cmocka_unit_test(test_rotations),
        cmocka_unit_test(test_far_origin),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    print_message("%u points at tips of needles, which are uncertain\n", (unsigned)n_tips);
    return failed;
}
