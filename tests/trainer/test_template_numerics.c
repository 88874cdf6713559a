/* The computations behind the design of a template network: motions of point sets, polynomials with
 * a chosen degree, free-form deformations.
 * Tests: freeform.c motion.c regression.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sdm/pose.h"
#include "template/freeform.h"
#include "template/motion.h"
#include "template/regression.h"

enum { POINTS = 40 };

// Random points, of which every second one is in the list of vertices.
typedef struct cloud {
    double from[3 * POINTS], to[3 * POINTS];
    uint32_t vertex[POINTS / 2];
} cloud;

static cloud make_cloud(uint64_t seed, bool flat)
{
    cloud c;
    for (uint64_t i = 0; i < 3 * POINTS; i++) {
        c.from[i] = flat && i % 3 == 2 ? 1 : 1 + 2 * sdm_rng_normal(seed, 1, i);
        c.to[i] = 1e3 * sdm_rng_normal(seed, 2, i); // points that do not belong to the set
    }
    for (uint32_t i = 0; i < POINTS / 2; i++) c.vertex[i] = 2 * i + 1;
    return c;
}

static void move(cloud *c, const motion *m)
{
    for (size_t k = 0; k < POINTS / 2; k++)
        for (size_t i = 0; i < 3; i++) {
            const double *x = c->from + 3 * c->vertex[k];
            c->to[3 * c->vertex[k] + i] =
                m->m[3 * i] * x[0] + m->m[3 * i + 1] * x[1] + m->m[3 * i + 2] * x[2] + m->b[i];
        }
}

static void expect_motion(const motion *found, const motion *truth, double tolerance)
{
    for (int i = 0; i < 9; i++) assert_true(fabs(found->m[i] - truth->m[i]) < tolerance);
    for (int i = 0; i < 3; i++) assert_true(fabs(found->b[i] - truth->b[i]) < 10 * tolerance);
}

static motion random_rotation(uint64_t i)
{
    sdm_pose pose = {{0}, {0}};
    motion m = {{0}, {0}};
    for (uint64_t a = 0; a < 3; a++) {
        pose.rotation[a] = sdm_rng_normal(31, a, i);
        m.b[a] = 5 * sdm_rng_normal(32, a, i);
    }
    sdm_pose_matrix(&pose, m.m);
    return m;
}

static void known_motions_are_found(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < 20; i++) {
        cloud c = make_cloud(i, false);
        motion rigid = random_rotation(i), affine = rigid, found;
        move(&c, &rigid);
        assert_true(trainer_motion_rigid(c.from, c.to, c.vertex, POINTS / 2, &found) < 1e-9);
        expect_motion(&found, &rigid, 1e-9);
        assert_true(trainer_motion_affine(c.from, c.to, c.vertex, POINTS / 2, &found) < 1e-9);
        expect_motion(&found, &rigid, 1e-9);
        for (uint64_t k = 0; k < 9; k++) affine.m[k] += 0.2 * sdm_rng_normal(33, k, i);
        move(&c, &affine);
        assert_true(trainer_motion_affine(c.from, c.to, c.vertex, POINTS / 2, &found) < 1e-9);
        expect_motion(&found, &affine, 1e-9);
        // The best rigid motion leaves the distance that it returns.
        const double left = trainer_motion_rigid(c.from, c.to, c.vertex, POINTS / 2, &found);
        double sum = 0;
        for (size_t k = 0; k < POINTS / 2; k++)
            for (size_t a = 0; a < 3; a++) {
                const double *x = c.from + 3 * c.vertex[k];
                const double e = found.m[3 * a] * x[0] + found.m[3 * a + 1] * x[1] +
                                 found.m[3 * a + 2] * x[2] + found.b[a] - c.to[3 * c.vertex[k] + a];
                sum += e * e;
            }
        assert_true(left > 0.01 && fabs(left - sqrt(sum / (POINTS / 2))) < 1e-9);
    }
}

// Points in a plane have no affine motion of their own: they get the rigid one.
static void plane_gets_rigid_motion(void **state)
{
    (void)state;
    cloud c = make_cloud(1, true);
    const motion rigid = random_rotation(1);
    motion found;
    move(&c, &rigid);
    assert_true(trainer_motion_affine(c.from, c.to, c.vertex, POINTS / 2, &found) < 1e-9);
    expect_motion(&found, &rigid, 1e-8);
}

static void motions_combine(void **state)
{
    (void)state;
    motion outer = random_rotation(3), inner = random_rotation(4), relative;
    outer.m[4] += 0.3;
    trainer_motion_relative(&outer, &inner, &relative);
    const double y[3] = {1, -2, 3};
    double x[3], back[3];
    for (int i = 0; i < 3; i++)
        x[i] = inner.m[3 * i] * y[0] + inner.m[3 * i + 1] * y[1] + inner.m[3 * i + 2] * y[2] +
               inner.b[i];
    trainer_motion_back(&outer, x, back); // outer^-1 inner y
    for (int i = 0; i < 3; i++)
        assert_true(fabs(back[i] - relative.b[i] - relative.m[3 * i] * y[0] -
                         relative.m[3 * i + 1] * y[1] - relative.m[3 * i + 2] * y[2]) < 1e-12);
}

// m = R (I + S) for the rotation vector and the stretch of the decomposition.
static void polar_decomposition(void **state)
{
    (void)state;
    for (uint64_t i = 0; i < 20; i++) {
        const motion turn = random_rotation(i);
        double s[6], m[9], w[3], found[6], r[9];
        for (uint64_t k = 0; k < 6; k++) s[k] = 0.15 * sdm_rng_normal(34, k, i);
        const double stretch[9] = {1 + s[0], s[5], s[4], s[5],    1 + s[1],
                                   s[3],     s[4], s[3], 1 + s[2]};
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++)
                m[3 * a + b] = turn.m[3 * a] * stretch[b] + turn.m[3 * a + 1] * stretch[3 + b] +
                               turn.m[3 * a + 2] * stretch[6 + b];
        trainer_motion_polar(m, w, found);
        sdm_pose_matrix(&(sdm_pose){.rotation = {w[0], w[1], w[2]}}, r);
        for (int k = 0; k < 9; k++) assert_true(fabs(r[k] - turn.m[k]) < 1e-9);
        for (int k = 0; k < 6; k++) assert_true(fabs(found[k] - s[k]) < 1e-9);
    }
}

/* Polynomials. */

enum { SAMPLES = 600, P = 2, NUMBERS = 2 };

static regression_data make_data(double *x, double *y, const double *weight, double noise)
{
    for (uint64_t i = 0; i < SAMPLES; i++) {
        double *at = x + i * P, *to = y + i * NUMBERS;
        for (uint64_t k = 0; k < P; k++) at[k] = 2 * sdm_rng_uniform(41, k, i) - 1;
        to[0] = 1 + 2 * at[0] - at[1] * at[1] + noise * sdm_rng_normal(42, 0, i);
        to[1] = at[0] * at[0] * at[1] - 0.5 * at[1] + noise * sdm_rng_normal(42, 1, i);
    }
    return (regression_data){P, SAMPLES, NUMBERS, x, y, weight};
}

static void polynomials_are_found(void **state)
{
    (void)state;
    double x[SAMPLES * P], y[SAMPLES * NUMBERS];
    const double weight[NUMBERS] = {1, 2};
    regression_data d = make_data(x, y, weight, 0);
    regression r;
    assert_int_equal(trainer_regression_fit(&d, 1e-4, &r, NULL), SDM_OK);
    assert_int_equal(r.degree, 3);
    assert_int_equal(r.n_terms, sdm_poly_count(P, 3));
    assert_true(r.error < 1e-5);
    uint8_t exponents[10 * P];
    float phi[10];
    sdm_poly_table(P, 3, exponents);
    for (uint64_t i = 0; i < 50; i++) {
        const double at[P] = {2 * sdm_rng_uniform(43, 0, i) - 1, 2 * sdm_rng_uniform(43, 1, i) - 1},
                     truth[NUMBERS] = {1 + 2 * at[0] - at[1] * at[1],
                                       at[0] * at[0] * at[1] - 0.5 * at[1]};
        sdm_poly_eval(exponents, 10, P, 3, at, phi, NULL);
        for (size_t k = 0; k < NUMBERS; k++) {
            double sum = 0;
            for (size_t t = 0; t < 10; t++) sum += r.function[k * 10 + t] * (double)phi[t];
            assert_true(fabs(sum - truth[k]) < 1e-5);
        }
    }
    trainer_regression_dispose(&r);
    // A number without an effect on the shape does not decide on the degree.
    const double first_only[NUMBERS] = {1, 0};
    d.weight = first_only;
    assert_int_equal(trainer_regression_fit(&d, 1e-4, &r, NULL), SDM_OK);
    assert_int_equal(r.degree, 2);
    trainer_regression_dispose(&r);
}

// With noise no degree reaches the tolerance: the one with the smallest error on the samples left
// out is taken, and this error is that of the noise.
static void noise_ends_the_search(void **state)
{
    (void)state;
    double x[SAMPLES * P], y[SAMPLES * NUMBERS];
    const double weight[NUMBERS] = {1, 2};
    const regression_data d = make_data(x, y, weight, 0.02);
    regression r;
    assert_int_equal(trainer_regression_fit(&d, 1e-4, &r, NULL), SDM_OK);
    assert_true(r.degree >= 3 && r.degree <= 6);
    assert_true(r.error > 0.03 && r.error < 0.05);
    trainer_regression_dispose(&r);
    // As many terms as the samples allow.
    regression_data few = d;
    few.n_samples = 17;
    assert_int_equal(trainer_regression_terms(17), 5);
    assert_int_equal(trainer_regression_fit(&few, 1e-4, &r, NULL), SDM_OK);
    assert_true(r.degree <= 1);
    trainer_regression_dispose(&r);
    few.n_numbers = 0;
    assert_int_equal(trainer_regression_fit(&few, 1e-4, &r, NULL), SDM_OK);
    assert_int_equal(r.degree, 0);
    trainer_regression_dispose(&r);
}

/* Free-form deformations. */

static double spline(double t) // the cubic B-spline of support -2 .. 2
{
    t = fabs(t);
    return t < 1 ? (4 - 6 * t * t + 3 * t * t * t) / 6 : t < 2 ? pow(2 - t, 3) / 6 : 0;
}

static void field_at(const sdm_lattice *l, const float *control, const double x[3], double u[3])
{
    memset(u, 0, 3 * sizeof *u);
    for (size_t i = 0; i < sdm_lattice_count(l); i++) {
        const size_t at[3] = {i % l->n[0], i / l->n[0] % l->n[1], i / l->n[0] / l->n[1]};
        double w = 1;
        for (int a = 0; a < 3; a++) w *= spline((x[a] - l->origin[a]) / l->spacing - (double)at[a]);
        for (size_t a = 0; a < 3; a++) u[a] += w * (double)control[3 * i + a];
    }
}

static void affine_field(const double x[3], double u[3])
{
    u[0] = 0.3 + 0.1 * x[0] - 0.2 * x[2];
    u[1] = 0.15 * x[1] + 0.05 * x[0];
    u[2] = -0.4 + 0.1 * x[2];
}

enum { PLACES = 400, FIELDS = 3 };

static void fields_are_continued(void **state)
{
    (void)state;
    const double min[3] = {-3, -4, -2}, max[3] = {5, 4, 3};
    const sdm_lattice l = trainer_freeform_lattice(min, max, 1.6);
    for (int a = 0; a < 3; a++) {
        // the splines cover the box: a control point lies a spacing before and after it
        assert_true(l.origin[a] + l.spacing <= min[a] + 1e-9);
        assert_true(l.origin[a] + l.spacing * (l.n[a] - 2.0) >= max[a] - 1e-9);
        assert_true(l.n[a] >= 4);
    }
    const size_t nodes = sdm_lattice_count(&l);
    double x[3 * PLACES], error;
    float values[FIELDS * 3 * PLACES], *control[3];
    // Points in one half of the box. Field 0 is affine, field 1 smooth, field 2 rough.
    for (uint64_t i = 0; i < PLACES; i++) {
        for (uint64_t a = 0; a < 3; a++) x[3 * i + a] = -2 + 3 * sdm_rng_uniform(51, a, i);
        double u[3];
        affine_field(x + 3 * i, u);
        for (size_t a = 0; a < 3; a++) {
            values[3 * i + a] = (float)u[a];
            values[3 * (PLACES + i) + a] = (float)sin(0.5 * x[3 * i + a]);
            values[3 * (2 * PLACES + i) + a] = (float)sdm_rng_normal(52, a, i);
        }
    }
    for (int threads = 1; threads <= 3; threads++) {
        assert_int_equal(SDM_ALLOC(&control[threads - 1], FIELDS * 3 * nodes, "control", NULL),
                         SDM_OK);
        assert_int_equal(trainer_freeform_fit(&l, PLACES, x, FIELDS, values, threads,
                                              control[threads - 1], &error, NULL),
                         SDM_OK);
        assert_memory_equal(control[threads - 1], control[0], FIELDS * 3 * nodes * sizeof(float));
    }
    // The error is that of the worst field.
    double sum[FIELDS] = {0}, u[3];
    for (size_t f = 0; f < FIELDS; f++)
        for (size_t i = 0; i < PLACES; i++) {
            field_at(&l, control[0] + 3 * nodes * f, x + 3 * i, u);
            for (size_t a = 0; a < 3; a++) {
                const double e = u[a] - (double)values[3 * (f * PLACES + i) + a];
                sum[f] += e * e / PLACES;
            }
        }
    assert_true(sqrt(sum[0]) < 1e-5 && sqrt(sum[1]) < 5e-3 && sqrt(sum[2]) > 0.5);
    assert_true(fabs(error - sqrt(sum[2])) < 1e-5);
    // An affine field is continued into the other half of the box.
    for (uint64_t i = 0; i < 100; i++) {
        double at[3], truth[3];
        for (int a = 0; a < 3; a++)
            at[a] = min[a] + (max[a] - min[a]) * sdm_rng_uniform(53, (uint64_t)a, i);
        field_at(&l, control[0], at, u);
        affine_field(at, truth);
        for (int a = 0; a < 3; a++) assert_true(fabs(u[a] - truth[a]) < 1e-3);
        // a smooth one stays of the same size
        field_at(&l, control[0] + 3 * nodes, at, u);
        for (int a = 0; a < 3; a++) assert_true(fabs(u[a]) < 3);
    }
    for (int i = 0; i < 3; i++) sdm_free(control[i]);
}

static void allocations_may_fail(void **state)
{
    (void)state;
    const sdm_lattice l =
        trainer_freeform_lattice((const double[]){0, 0, 0}, (const double[]){1, 1, 1}, 1);
    const double x[3] = {0.5, 0.5, 0.5}, weight[NUMBERS] = {1, 1};
    const float values[3] = {1, 2, 3};
    float control[3 * 64];
    double error, places[SAMPLES * P], y[SAMPLES * NUMBERS];
    const regression_data d = make_data(places, y, weight, 0);
    unsigned long n = 1;
    sdm_status s = SDM_E_NOMEM;
    for (; s; n++) {
        sdm_alloc_fail_after(n);
        s = trainer_freeform_fit(&l, 1, x, 1, values, 1, control, &error, NULL);
        sdm_alloc_fail_after(0);
        assert_true((s == SDM_OK || s == SDM_E_NOMEM) && n < 50);
    }
    assert_true(n > 5);
    s = SDM_E_NOMEM;
    for (n = 1; s; n++) {
        regression r;
        sdm_alloc_fail_after(n);
        s = trainer_regression_fit(&d, 1e-4, &r, NULL);
        sdm_alloc_fail_after(0);
        assert_true((s == SDM_OK || s == SDM_E_NOMEM) && n < 100);
        trainer_regression_dispose(&r);
    }
    assert_true(n > 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_motions_are_found), cmocka_unit_test(plane_gets_rigid_motion),
        cmocka_unit_test(motions_combine),         cmocka_unit_test(polar_decomposition),
        cmocka_unit_test(polynomials_are_found),   cmocka_unit_test(noise_ends_the_search),
        cmocka_unit_test(fields_are_continued),    cmocka_unit_test(allocations_may_fail)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
