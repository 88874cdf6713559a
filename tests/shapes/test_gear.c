/* The gear wheel of examples/gear, a plug-in: its volume against the area of its profile, its
 * velocities against differences, and its turn by one pitch. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "shape_tools.h"

#define PI 3.14159265358979323846

static int load(void **state)
{
    return set_up(state) || sdm_registry_load(registry, GEAR_PLUGIN, NULL);
}

static void test_solid_of_known_volume(void **state)
{
    (void)state;
    static const char *const OPTIONS[] = {"teeth=6 bore=1.6", "", "teeth=40 bore=0.2"};
    static const double TEETH[] = {6, 10, 40}, BORE[] = {1.6, 1, 0.2};
    for (int i = 0; i < 3; i++) {
        sdm_instance *s = shape_make("gear", OPTIONS[i]);
        size_t n;
        const sdm_param *params = sdm_instance_params(s, &n);
        assert_int_equal(n, 4);
        assert_true(fabs(params[0].max - PI / TEETH[i]) < 1e-15);
        sdm_mesh m = {0};
        for (int round = 0; round < 10; round++) {
            double p[4];
            random_params(s, p);
            mesh_at(s, p, &m);
            sdm_audit a;
            assert_int_equal(sdm_mesh_audit(&m, &a, NULL), SDM_OK);
            assert_true(a.closed && a.manifold && !a.inverted);
            assert_int_equal(a.components, 1);
            assert_int_equal(a.degenerate + a.self_intersections, 0);
            assert_int_equal(m.n_tri, 2 * m.n_vert); // one handle: Euler characteristic 0
            // The profile is cut into triangles at the axis; in pitches, the tips take 0.28, the
            // two flanks 0.18 each, the gap 0.36.
            const double pitch = 2 * PI / TEETH[i], tip = p[1], root = p[1] - p[2];
            const double round_all =
                sin(0.28 * pitch) * tip * tip + 2 * sin(0.18 * pitch) * tip * root +
                sin(0.36 * pitch) * root * root -
                (sin(0.28 * pitch) + 2 * sin(0.18 * pitch) + sin(0.36 * pitch)) * BORE[i] * BORE[i];
            assert_true(fabs(a.volume - TEETH[i] * round_all / 2 * p[3]) < 1e-9 * a.volume);
            assert_true(fabs(a.max[2] - p[3] / 2) < 1e-12 && fabs(a.min[2] + p[3] / 2) < 1e-12);
        }
        sdm_mesh_dispose(&m);
        sdm_instance_free(s);
    }
}

static void test_velocities_match_differences(void **state)
{
    (void)state;
    velocity_check("gear", "", 4, 1e-8);
    velocity_check("gear", "teeth=23 bore=0.5", 4, 1e-8);
}

// The two ends of the range of the angle are the same wheel: every vertex of one is a vertex of the
// other.
static void test_turn_by_a_pitch(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("gear", "teeth=7");
    sdm_mesh m[2] = {{0}, {0}};
    double p[4] = {PI / 7, 4, 0.9, 1.3};
    mesh_at(s, p, &m[0]);
    p[0] = -PI / 7;
    mesh_at(s, p, &m[1]);
    for (size_t v = 0; v < m[0].n_vert; v++) {
        double nearest = INFINITY;
        for (size_t w = 0; w < m[1].n_vert; w++) {
            const double *x = m[0].vert + 3 * v, *y = m[1].vert + 3 * w;
            nearest = fmin(nearest, hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]));
        }
        assert_true(nearest < 1e-12);
    }
    sdm_mesh_dispose(&m[0]);
    sdm_mesh_dispose(&m[1]);
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_solid_of_known_volume),
        cmocka_unit_test(test_velocities_match_differences),
        cmocka_unit_test(test_turn_by_a_pitch),
    };
    return cmocka_run_group_tests(tests, load, tear_down);
}
