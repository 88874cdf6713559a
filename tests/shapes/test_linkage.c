/* The linkage: components that move rigidly, joints where trigonometry puts them, velocities
 * against differences, the closed form against the exact engine, and refused options.
 * Tests: linkage.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/exact.h"
#include "shape_tools.h"

#define PI 3.14159265358979323846

// Every sort of linkage: planar and spatial, with and without base and joint balls, tapering to
// either end.
static const char *const SORTS[] = {
    "edge=0.5",
    "edge=0.5 links=1 base=0 joint=1",
    "edge=0.5 links=8 motion=spatial length=2 radius=0.5 tip=0.3 joint=1.5 limit=3",
    "edge=0.4 links=4 motion=spatial base=1.6 joint=1 tip=1.2 limit=2.5",
    "edge=0.5 links=5 motion=planar base=0 joint=2 radius=0.7 limit=0.5",
};
#define N_SORTS (sizeof SORTS / sizeof *SORTS)
static const size_t N_LINKS[N_SORTS] = {3, 1, 8, 4, 5}, N_BASES[N_SORTS] = {1, 0, 1, 1, 0};
static const double LIMITS[N_SORTS] = {1.2, 1.2, 3, 2.5, 0.5};

// The first vertex of the component of every vertex.
static void label_components(const sdm_mesh *m, uint32_t *label)
{
    for (size_t v = 0; v < m->n_vert; v++) label[v] = (uint32_t)v;
    for (bool changed = true; changed;) {
        changed = false;
        for (size_t t = 0; t < m->n_tri; t++) {
            const uint32_t *v = m->tri + 3 * t;
            uint32_t least = label[v[0]];
            for (int k = 1; k < 3; k++) least = label[v[k]] < least ? label[v[k]] : least;
            for (int k = 0; k < 3; k++) {
                changed |= label[v[k]] != least;
                label[v[k]] = least;
            }
        }
    }
}

static double gap(const sdm_mesh *m, size_t v, size_t w)
{
    const double *x = m->vert + 3 * v, *y = m->vert + 3 * w;
    return hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]);
}

static void test_components_move_rigidly(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SORTS; i++) {
        sdm_instance *s = shape_make("linkage", SORTS[i]);
        size_t n;
        const sdm_param *params = sdm_instance_params(s, &n);
        assert_int_equal(n, N_LINKS[i]);
        assert_string_equal(params[n - 1].unit, "rad");
        assert_true(params[0].min == -LIMITS[i] && params[n - 1].max == LIMITS[i]);
        sdm_mesh m[2] = {{0}, {0}};
        uint32_t *label = NULL;
        for (int round = 0; round < 6; round++) {
            double p[8];
            sdm_audit a;
            sdm_error err = {0};
            random_params(s, p);
            mesh_at(s, p, &m[round > 0]);
            if (sdm_mesh_audit(&m[round > 0], &a, &err)) fail_msg("%s", err.text);
            assert_true(a.closed && a.manifold && !a.inverted);
            assert_int_equal(a.components, N_LINKS[i] + N_BASES[i]);
            assert_int_equal(a.degenerate + a.duplicate, 0);
            if (round == 0) {
                assert_int_equal(SDM_ALLOC(&label, m[0].n_vert, "labels", NULL), SDM_OK);
                label_components(&m[0], label);
                continue;
            }
            assert_int_equal(m[1].n_vert, m[0].n_vert);
            assert_memory_equal(m[1].tri, m[0].tri, 3 * m[0].n_tri * sizeof *m[0].tri);
            double moved = 0;
            for (size_t v = 0; v < m[0].n_vert; v++) {
                for (size_t w = 0; w < v; w++)
                    if (label[w] == label[v])
                        assert_true(fabs(gap(&m[1], v, w) - gap(&m[0], v, w)) < 1e-9);
                for (size_t k = 3 * v; k < 3 * v + 3; k++)
                    if (label[v] == 0 && N_BASES[i])
                        assert_true(m[1].vert[k] == m[0].vert[k]); // the base stands still
                    else
                        moved = fmax(moved, fabs(m[1].vert[k] - m[0].vert[k]));
            }
            assert_true(moved > 0.1);
        }
        sdm_free(label);
        sdm_mesh_dispose(&m[0]);
        sdm_mesh_dispose(&m[1]);
        sdm_instance_free(s);
    }
}

// The last vertex is the end of the last link: a sum of cosines and sines.
static void test_end_is_where_the_angles_put_it(void **state)
{
    (void)state;
    for (int spatial = 0; spatial < 2; spatial++) {
        sdm_instance *s = shape_make(
            "linkage", spatial ? "links=4 length=2 tip=0.5 motion=spatial limit=3"
                               : "links=4 length=2 tip=0.5 motion=planar base=0 limit=3");
        sdm_mesh m = {0};
        for (int round = 0; round < 20; round++) {
            double p[4], out = 0, side = 0;
            random_params(s, p);
            mesh_at(s, p, &m);
            double angle = spatial ? 0 : p[0];
            for (int i = 0; i < 4; i++) {
                if (i > 0) angle += p[i];
                out += (i < 3 ? 2 : 2.5) * cos(angle);
                side += (i < 3 ? 2 : 2.5) * sin(angle);
            }
            const double *end = m.vert + 3 * (m.n_vert - 1);
            assert_true(fabs(end[0] - (spatial ? out * cos(p[0]) : out)) < 1e-12);
            assert_true(fabs(end[1] - (spatial ? out * sin(p[0]) : side)) < 1e-12);
            assert_true(fabs(end[2] - (spatial ? side : 0)) < 1e-12);

            // A planar arm reaches as far above and below its plane as its thickest ball.
            double low = 0, high = 0;
            for (size_t v = 0; v < m.n_vert && !spatial; v++) {
                low = fmin(low, m.vert[3 * v + 2]);
                high = fmax(high, m.vert[3 * v + 2]);
            }
            if (!spatial) assert_true(high > 1 && high <= 1.08 && low < -1 && low >= -1.08);
        }
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
}

static void test_velocities_match_differences(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_SORTS; i++) velocity_check("linkage", SORTS[i], 3, 1e-6);
}

// One link alone: all vertices lie on the surface of the closed form; a capsule has a known volume.
static void test_vertices_on_surface(void **state)
{
    (void)state;
    static const char *const LINKS[] = {"links=1 base=0 joint=1 radius=0.7 tip=0.7 edge=0.1",
                                        "links=1 base=0 joint=1.6 radius=0.5 tip=1",
                                        "links=1 base=0 joint=1.3 radius=1 tip=0.4"};
    for (size_t i = 0; i < 3; i++) {
        sdm_instance *s = shape_make("linkage", LINKS[i]);
        sdm_mesh m = {0};
        double p[1];
        random_params(s, p);
        mesh_at(s, p, &m);
        for (size_t v = 0; v < m.n_vert; v++)
            assert_true(fabs(distance_at(s, p, m.vert + 3 * v)) < 1e-12);
        sdm_audit a;
        assert_int_equal(sdm_mesh_audit(&m, &a, NULL), SDM_OK);
        assert_int_equal(a.self_intersections, 0);
        if (i == 0) {
            const double missing = 1 - a.volume / (PI * 0.49 * 3 + 4 * PI / 3 * 0.343);
            assert_true(missing > 0 && missing < 0.006);
        }
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
}

/* The exact distance to a fine mesh against the closed form. The mesh lies inside the shape, by at
 * most `sag` mm, so outside it is farther away by at most that. Inside, the closed form may say
 * less depth than there is, never more. */
static void test_distance_matches_exact_engine(void **state)
{
    (void)state;
    static const char *const FINE[] = {
        "edge=0.12 links=2 length=2 joint=1.4",
        "edge=0.12 links=4 motion=spatial length=2 radius=0.7 limit=2.8",
    };
    const double sag = 0.01;
    for (size_t i = 0; i < 2; i++) {
        sdm_instance *s = shape_make("linkage", FINE[i]);
        sdm_mesh m = {0};
        int outside = 0, inside = 0;
        for (int round = 0; round < 3; round++) {
            double p[8];
            random_params(s, p);
            mesh_at(s, p, &m);
            sdm_exact *e = NULL;
            sdm_error err = {0};
            if (sdm_exact_create(&m, NULL, &e, &err)) fail_msg("%s", err.text);
            assert_true(sdm_exact_get_report(e)->unioned);
            for (int k = 0; k < 3000; k++) {
                const double *near = m.vert + 3 * (size_t)random_in(0, (double)m.n_vert - 1),
                             x[3] = {near[0] + random_in(-1, 1), near[1] + random_in(-1, 1),
                                     near[2] + random_in(-1, 1)};
                const double closed = distance_at(s, p, x),
                             exact = sdm_exact_point(e, x, NULL, NULL, NULL);
                if (closed > 0) {
                    assert_true(exact > closed - 1e-9 && exact < closed + sag);
                    outside++;
                } else {
                    assert_true(exact < closed + sag);
                    inside++;
                }
            }
            sdm_exact_free(e);
        }
        assert_true(outside > 1000 && inside > 1000);
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
}

static void test_options_are_checked(void **state)
{
    (void)state;
    static const char *const BAD[][3] = {
        {"links", "0", "option 'links' is 0, need 1 .. 8"},
        {"links", "9", "option 'links' is 9, need 1 .. 8"},
        {"limit", "3.2", "option 'limit' is 3.2 rad, need 0.01 .. 3"},
        {"motion", "round", "option 'motion' is 'round', need one of planar|spatial"},
        {"joint", "0.9", "option 'joint' is 0.9, need 1 .. 2"},
        {"length", "0.5",
         "link 1 is too short, 0.5 mm between balls of radius 0.9 and 0.96 mm: raise 'length', or "
         "lower 'radius', 'tip' or 'joint'"},
        {"tip", "15", "link 1 is too short, 3 mm between balls of radius 0.9 and 6.72 mm"},
        {"base", "0.5",
         "the base is too short, 0.5 mm between balls of radius 0.9 and 1.08 mm: raise 'base', or "
         "lower 'radius' or 'joint'"},
    };
    for (size_t i = 0; i < sizeof BAD / sizeof *BAD; i++) {
        const sdm_named_text given = {BAD[i][0], BAD[i][1]};
        sdm_instance *s = NULL;
        sdm_error err = {0};
        assert_int_not_equal(sdm_instance_create(sdm_registry_find(registry, "linkage", NULL),
                                                 &given, 1, NULL, &s, &err),
                             SDM_OK);
        assert_null(s);
        if (!strstr(err.text, BAD[i][2])) fail_msg("'%s' is not in '%s'", BAD[i][2], err.text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_components_move_rigidly),
        cmocka_unit_test(test_end_is_where_the_angles_put_it),
        cmocka_unit_test(test_velocities_match_differences),
        cmocka_unit_test(test_vertices_on_surface),
        cmocka_unit_test(test_distance_matches_exact_engine),
        cmocka_unit_test(test_options_are_checked),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
