/* Rigid poses against the vector form of Rodrigues' formula, against each other and against
 * differences.
 * Tests: pose.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/mat3.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/rotation.h"
#include "sdm/pose.h"

#define PI 3.14159265358979323846

static double norm(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

/* Rodrigues' formula: x rotated about the unit vector k by `angle`: x cos + (k x x) sin + k
 * (k.x)(1 - cos). */
static void rodrigues_rotate(const double k[3], double angle, const double x[3], double out[3])
{
    const double dot = k[0] * x[0] + k[1] * x[1] + k[2] * x[2], c = cos(angle), s = sin(angle);
    const double cross[3] = {k[1] * x[2] - k[2] * x[1], k[2] * x[0] - k[0] * x[2],
                             k[0] * x[1] - k[1] * x[0]};
    for (int i = 0; i < 3; i++) out[i] = x[i] * c + cross[i] * s + k[i] * dot * (1 - c);
}

static void random_axis(uint64_t seed, double k[3])
{
    for (uint64_t i = 0; i < 3; i++) k[i] = sdm_rng_normal(seed, 1, i);
    const double n = norm(k);
    for (int i = 0; i < 3; i++) k[i] /= n;
}

static sdm_pose random_pose(uint64_t seed, double angle)
{
    sdm_pose p;
    random_axis(seed, p.rotation);
    for (int i = 0; i < 3; i++) p.rotation[i] *= angle;
    for (uint64_t i = 0; i < 3; i++) p.translation[i] = 10 * sdm_rng_normal(seed, 2, i);
    return p;
}

static void assert_near(const double *a, const double *b, int n, double tolerance)
{
    for (int i = 0; i < n; i++)
        if (!(fabs(a[i] - b[i]) <= tolerance))
            fail_msg("number %d is %.17g, expected %.17g", i, a[i], b[i]);
}

static const double ANGLES[] = {0, 1e-300, 1e-160, 1e-9, 1e-4, 0.3, 0.999, 1.001, 2, PI - 1e-9, PI};
enum { N_ANGLES = sizeof ANGLES / sizeof *ANGLES };

static void test_apply_matches_rodrigues(void **state)
{
    (void)state;
    for (size_t a = 0; a < N_ANGLES; a++) {
        const sdm_pose p = random_pose(a, ANGLES[a]);
        double k[3], expected[3], got[3], back[3], in_place[3] = {1.5, -2, 0.25};
        const double x[3] = {1.5, -2, 0.25};
        random_axis(a, k);
        rodrigues_rotate(k, ANGLES[a], x, expected);
        for (int i = 0; i < 3; i++) expected[i] += p.translation[i];
        sdm_pose_apply(&p, x, got);
        assert_near(got, expected, 3, 1e-13);
        sdm_pose_apply_inverse(&p, got, back);
        assert_near(back, x, 3, 1e-13);
        sdm_pose_apply(&p, in_place, in_place);
        assert_near(in_place, expected, 3, 1e-13);
        sdm_pose_apply_inverse(&p, in_place, in_place);
        assert_near(in_place, x, 3, 1e-13);
        const sdm_pose inverse = sdm_pose_inverse(&p);
        sdm_pose_apply(&inverse, expected, got);
        assert_near(got, x, 3, 1e-13);
    }
    /* A rotation by pi / 2 about z maps the x axis to the y axis. */
    const sdm_pose quarter = {.rotation = {0, 0, PI / 2}, .translation = {0, 0, 5}};
    double got[3];
    sdm_pose_apply(&quarter, (const double[3]){1, 0, 0}, got);
    assert_near(got, (const double[3]){0, 1, 5}, 3, 1e-15);
}

static void test_compose_applies_in_turn(void **state)
{
    (void)state;
    const double x[3] = {0.7, -3, 2};
    for (size_t a = 0; a < N_ANGLES; a++)
        for (size_t b = 0; b < N_ANGLES; b++) {
            const sdm_pose outer = random_pose(a, ANGLES[a]),
                           inner = random_pose(b + 20, ANGLES[b]);
            const sdm_pose both = sdm_pose_compose(&outer, &inner);
            double step[3], expected[3], got[3];
            sdm_pose_apply(&inner, x, step);
            sdm_pose_apply(&outer, step, expected);
            sdm_pose_apply(&both, x, got);
            assert_near(got, expected, 3, 1e-13);
            assert_true(norm(both.rotation) <= PI * (1 + 1e-15));
        }
    /* Three thirds of a full turn compose to no rotation. */
    const sdm_pose third = random_pose(5, 2 * PI / 3), two = sdm_pose_compose(&third, &third),
                   three = sdm_pose_compose(&third, &two);
    assert_near(three.rotation, (const double[3]){0, 0, 0}, 3, 1e-14);
}

static void test_matrix_to_vector_and_back(void **state)
{
    (void)state;
    for (size_t a = 0; a < N_ANGLES; a++)
        for (uint64_t seed = 0; seed < 8; seed++) {
            sdm_pose p = random_pose(seed, ANGLES[a]);
            // The first three seeds rotate about the coordinate axes.
            if (seed < 3)
                for (int i = 0; i < 3; i++) p.rotation[i] = (uint64_t)i == seed ? ANGLES[a] : 0;
            double r[9], v[3], again[9];
            sdm_pose_matrix(&p, r);
            sdm_rotation_vector(r, v);
            assert_true(norm(v) <= PI * (1 + 1e-15));
            // at pi the vectors v and -v are the same rotation
            if (ANGLES[a] < 3.1) assert_near(v, p.rotation, 3, 1e-14);
            const sdm_pose q = {.rotation = {v[0], v[1], v[2]}};
            sdm_pose_matrix(&q, again);
            assert_near(again, r, 9, 1e-14);
        }
    /* A rotation by 3 pi / 2 becomes one by -pi / 2. */
    const sdm_pose long_way = {.rotation = {0, 3 * PI / 2, 0}};
    double r[9], v[3];
    sdm_pose_matrix(&long_way, r);
    sdm_rotation_vector(r, v);
    assert_near(v, (const double[3]){0, -PI / 2, 0}, 3, 1e-14);
}

static void test_products_match_matrices(void **state)
{
    (void)state;
    for (size_t a = 0; a < N_ANGLES; a++)
        for (size_t b = 0; b < N_ANGLES; b++) {
            const sdm_pose outer = random_pose(a, ANGLES[a]),
                           inner = random_pose(b + 20, ANGLES[b]);
            const sdm_pose both = sdm_pose_compose(&outer, &inner);
            double r[9], s[9], expected[9], got[9];
            sdm_pose_matrix(&outer, r);
            sdm_pose_matrix(&inner, s);
            sdm_pose_matrix(&both, expected);
            m3_product(r, s, got);
            assert_near(got, expected, 9, 1e-13);
        }
}

static void test_quaternion_to_vector(void **state)
{
    (void)state;
    // q and -q are the same rotation.
    for (size_t a = 0; a < N_ANGLES; a++)
        for (int sign = -1; sign <= 1; sign += 2) {
            double k[3], rotation[3];
            random_axis(a, k);
            const double c = sign * cos(0.5 * ANGLES[a]), s = sign * sin(0.5 * ANGLES[a]);
            const double q[4] = {c, s * k[0], s * k[1], s * k[2]};
            sdm_rotation_of_quaternion(q, rotation);
            const double expected[3] = {ANGLES[a] * k[0], ANGLES[a] * k[1], ANGLES[a] * k[2]};
            // at pi the vectors v and -v are the same rotation
            if (ANGLES[a] < 3.1) assert_near(rotation, expected, 3, 1e-14);
            assert_near((const double[1]){norm(rotation)}, &ANGLES[a], 1, 1e-14);
        }
    /* A rotation by 3 pi / 2 becomes one by -pi / 2. */
    double rotation[3];
    sdm_rotation_of_quaternion((const double[4]){cos(3 * PI / 4), 0, sin(3 * PI / 4), 0}, rotation);
    assert_near(rotation, (const double[3]){0, -PI / 2, 0}, 3, 1e-14);
}

static void test_jacobian_matches_differences(void **state)
{
    (void)state;
    const double step = 1e-5;
    for (size_t a = 0; a < N_ANGLES; a++) {
        const sdm_pose p = random_pose(a, ANGLES[a]);
        double j[9];
        sdm_rotation_jacobian(p.rotation, j);
        for (int c = 0; c < 3; c++) {
            sdm_pose up = p, down = p;
            up.rotation[c] += step;
            down.rotation[c] -= step;
            const sdm_pose down_back = sdm_pose_inverse(&down);
            const sdm_pose between = sdm_pose_compose(&up, &down_back);
            for (int i = 0; i < 3; i++) {
                const double difference = between.rotation[i] / (2 * step);
                if (!(fabs(difference - j[3 * i + c]) < 1e-9))
                    fail_msg("angle %g: d%d/d%d is %.12g, difference %.12g", ANGLES[a], i, c,
                             j[3 * i + c], difference);
            }
        }
    }
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_error err;
    sdm_pose p = {.rotation = {0}};
    assert_int_equal(sdm_pose_check(&p, &err), SDM_OK);
    assert_int_equal(sdm_pose_check(NULL, &err), SDM_E_ARG);
    for (int i = 0; i < 3; i++) {
        p = (sdm_pose){.rotation = {0}};
        p.translation[i] = NAN;
        assert_int_equal(sdm_pose_check(&p, &err), SDM_E_ARG);
        assert_non_null(strstr(err.text, "translation"));
        p = (sdm_pose){.rotation = {0}};
        p.rotation[i] = -INFINITY;
        assert_int_equal(sdm_pose_check(&p, &err), SDM_E_ARG);
        assert_non_null(strstr(err.text, "rotation"));
        p.rotation[i] = 1001;
        assert_int_equal(sdm_pose_check(&p, NULL), SDM_E_ARG);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_apply_matches_rodrigues),
        cmocka_unit_test(test_compose_applies_in_turn),
        cmocka_unit_test(test_matrix_to_vector_and_back),
        cmocka_unit_test(test_products_match_matrices),
        cmocka_unit_test(test_quaternion_to_vector),
        cmocka_unit_test(test_jacobian_matches_differences),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
