/* The tissue field (weights of the tissues outside that vary in space): an ellipsoid with bone on
 * one side and a darker tissue on the other.
 * Tests: blur.c evidence.c information.c neighbours.c posterior.c samples.c tissue_field.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/solver/objective.h"
#include "fit/solver/tissue_field.h"
#include "oracle/fit_tools.h"

#define BONE 1300.0
#define DARK 600.0

static void voxel_position(const sdm_grid *g, size_t i, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    sdm_grid_world(
        g, (const double[3]){(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)}, x);
}

// A phantom in which a darker tissue replaces bone where x > 0.3 mm, also in voxels that contain
// both bone and shape.
static float *two_sides(uint64_t seed)
{
    const sdm_grid g = image_grid();
    float *v = phantom(TRUTH, &POSE, 0.5, seed);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        double x[3];
        voxel_position(&g, i, x);
        if (x[0] > 0.3) v[i] = (float)(40 + (DARK - 40) / (BONE - 40) * ((double)v[i] - 40));
    }
    return v;
}

static sdm_fit_opts options(void)
{
    sdm_fit_opts o = near_start();
    o.appearance.n_outside = 2;
    o.appearance.outside[1] = (sdm_fit_law){.weight = 0.5, .mean = DARK, .sd = 100};
    o.appearance.outside[0].weight = 0.5;
    return o;
}

// Creates a problem with its state at the truth and evaluates it.
static void problem_at_truth(fit_problem *p, const sdm_fit_source *source)
{
    p->source = source;
    p->n_params = 3, p->stride = 1, p->noise_factor = 1, p->use_tissue_field = true;
    for (int k = 0; k < 3; k++) p->low[k] = 1, p->high[k] = 4;
    p->maps_params[0] = p->maps_blur = NAN;
    p->state = (fit_state){.blur = 0.25, .appearance = p->opts->appearance};
    sdm_pose_matrix(&POSE, p->state.rotation);
    memcpy(p->state.translation, POSE.translation, sizeof POSE.translation);
    memcpy(p->state.params, TRUTH, sizeof TRUTH);
    assert_int_equal(sdm_fit_maps_create(source, true, p->opts, &p->maps, NULL), SDM_OK);
    assert_int_equal(sdm_fit_information_create(fit_columns(3) + 3, &p->information, NULL), SDM_OK);
    const fit_region region = {.centre = {0.3, -0.2, 0.1}, .radius = 9};
    bool changed;
    assert_int_equal(
        sdm_fit_samples_choose(p->target, p->opts, &region, 1, &p->samples, &changed, NULL),
        SDM_OK);
    assert_int_equal(sdm_fit_evaluate(p, NULL), SDM_OK);
}

static void problem_free(fit_problem *p)
{
    sdm_fit_maps_dispose(&p->maps);
    sdm_fit_samples_dispose(&p->samples);
    sdm_fit_information_dispose(&p->information);
}

static void test_weights_follow_the_tissues(void **state)
{
    (void)state;
    float *v = two_sides(3), *first = NULL;
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = options();
    const sdm_fit_source source = exact_source();
    for (int threads = 1; threads <= 3; threads += 2) {
        o.n_threads = threads;
        fit_problem p = {.target = &t, .opts = &o};
        problem_at_truth(&p, &source);
        const double before = p.information.log_likelihood;
        assert_int_equal(sdm_fit_tissue_field_update(&p, NULL), SDM_OK);
        const fit_samples *s = &p.samples;
        assert_int_equal(s->n_outside, 2);
        assert_true(p.information.log_likelihood > before + 500);
        for (size_t i = 0; i < s->n; i++) {
            const double bone = exp((double)s->log_weight[2 * i]),
                         dark = exp((double)s->log_weight[2 * i + 1]);
            assert_true(fabs(bone + dark - 1) < 1e-5);
            if (s->world[3 * i] > 2.3) assert_true(dark > 0.85);
            if (s->world[3 * i] < -1.7) assert_true(bone > 0.85);
        }
        // The log-likelihood computed without derivatives is the same.
        assert_true(fabs(sdm_fit_samples_log_likelihood(s, &p.maps, &p.observation, &p.state) /
                             p.information.log_likelihood -
                         1) < 1e-12);
        const size_t size = 2 * s->n * sizeof *s->log_weight;
        if (!first) {
            first = malloc(size);
            if (!first) abort();
            memcpy(first, s->log_weight, size);
        } else {
            assert_memory_equal(first, s->log_weight, size);
        }
        problem_free(&p);
    }
    free(first);
    free(v);
}

// A window much narrower than the cells of the tissue field.
static void test_narrow_window(void **state)
{
    (void)state;
    float *v = two_sides(6);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = options();
    const sdm_fit_source source = exact_source();
    o.tissue_mm = 0.02;
    fit_problem p = {.target = &t, .opts = &o};
    problem_at_truth(&p, &source);
    assert_int_equal(sdm_fit_tissue_field_update(&p, NULL), SDM_OK);
    assert_int_equal(p.samples.n_outside, 2);
    for (size_t i = 0; i < p.samples.n; i++) {
        const double bone = exp((double)p.samples.log_weight[2 * i]),
                     dark = exp((double)p.samples.log_weight[2 * i + 1]);
        assert_true(fabs(bone + dark - 1) < 1e-5);
    }
    assert_true(isfinite(p.information.log_likelihood));
    problem_free(&p);
    free(v);
}

// No field is used when it is switched off, the appearance is kept, the fit has not enabled it, or
// the noise is too correlated to tell two tissues apart.
static void test_cases_without_field(void **state)
{
    (void)state;
    float *v = two_sides(4);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = options();
    const sdm_fit_source source = exact_source();
    fit_problem p = {.target = &t, .opts = &o};
    problem_at_truth(&p, &source);
    const double before = p.information.log_likelihood;
    for (int way = 0; way < 4; way++) {
        o = options();
        if (way == 0) o.tissue_mm = 0;
        if (way == 1) o.keep_appearance = true;
        p.use_tissue_field = way != 2;
        p.noise_factor = way == 3 ? 1e4 : 1;
        assert_int_equal(sdm_fit_tissue_field_update(&p, NULL), SDM_OK);
        assert_int_equal(p.samples.n_outside, 0);
        assert_true(p.information.log_likelihood == before);
    }
    problem_free(&p);
    free(v);
}

// A darker tissue on one side does not bias the estimate.
static void test_field_removes_the_bias(void **state)
{
    (void)state;
    float *v = two_sides(5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = options();
    sdm_fit_result with = fit(&t, &o);
    o.tissue_mm = 0;
    sdm_fit_result without = fit(&t, &o);
    if (!(with.log_likelihood - without.log_likelihood > 20 * with.noise_factor))
        fail_msg("log-likelihood %g with a tissue field, %g without", with.log_likelihood,
                 without.log_likelihood);
    double e[9];
    errors(&with, TRUTH, &POSE, e);
    for (size_t k = 0; k < 9; k++)
        if (!(fabs(e[k]) < 4 * with.sd[k]))
            fail_msg("unknown %zu is off by %g, sd %g", k, e[k], with.sd[k]);
    sdm_fit_dispose(&with);
    sdm_fit_dispose(&without);
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_weights_follow_the_tissues),
        cmocka_unit_test(test_narrow_window),
        cmocka_unit_test(test_cases_without_field),
        cmocka_unit_test(test_field_removes_the_bias),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
