/* Coarse maps of the search: their grid, and a likelihood that is nearly that of the fine ones.
 * Tests: coarse_maps.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/solver/objective.h"
#include "fit/start/coarse_maps.h"
#include "oracle/fit_tools.h"

static void problem_create(fit_problem *p, const sdm_fit_source *source, const sdm_fit_target *t,
                           const sdm_fit_opts *o)
{
    *p = (fit_problem){.source = source, .target = t, .opts = o, .n_params = 3, .stride = 1};
    assert_int_equal(sdm_fit_maps_create(source, true, o, &p->maps, NULL), SDM_OK);
    p->state = (fit_state){.blur = 0.6, .appearance = o->appearance};
    sdm_pose_matrix(&POSE, p->state.rotation);
    memcpy(p->state.translation, POSE.translation, sizeof POSE.translation);
    memcpy(p->state.params, TRUTH, sizeof TRUTH);
    p->maps_params[0] = p->maps_blur = NAN;
    bool changed;
    const fit_region region = {.centre = {0.3, -0.2, 0.1}, .radius = 9};
    assert_int_equal(sdm_fit_information_create(fit_columns(3) + 2, &p->information, NULL), SDM_OK);
    assert_int_equal(sdm_fit_samples_choose(t, o, &region, 1, &p->samples, &changed, NULL), SDM_OK);
}

static double likelihood(fit_problem *p)
{
    assert_int_equal(sdm_fit_evaluate(p, NULL), SDM_OK);
    return p->information.log_likelihood;
}

static void coarse_maps_show_a_wide_blur(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_source source = exact_source();
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    fit_problem p;
    fit_maps fine;
    problem_create(&p, &source, &t, &o);
    const double with_fine = likelihood(&p);
    // what the likelihood loses by a motion of a fine voxel
    p.state.translation[0] += 0.25;
    const double moved = fabs(likelihood(&p) - with_fine);
    p.state.translation[0] -= 0.25;
    // every second voxel, to the end of the grid
    assert_int_equal(sdm_fit_coarse_maps_begin(&p, &fine, NULL), SDM_OK);
    for (int a = 0; a < 3; a++) {
        assert_true(p.maps.grid.spacing[a] == 0.5);
        assert_true(p.maps.grid.origin[a] == source.grid.origin[a]);
        assert_true(p.maps.grid.n[a] == source.grid.n[a] / 2 + 1);
    }
    const double with_coarse = likelihood(&p);
    if (!(fabs(with_coarse - with_fine) < 0.5 * moved))
        fail_msg("log-likelihood %g, coarse %g, moved by %g", with_fine, with_coarse, moved);
    // the fine maps come back, and the coarse one is counted
    const size_t before = fine.n_exact;
    sdm_fit_coarse_maps_end(&p, &fine);
    assert_true(p.maps.grid.n[0] == source.grid.n[0]);
    assert_true(p.maps.n_exact == before + 1);
    assert_true(likelihood(&p) == with_fine);
    // a narrow blur needs the fine maps
    const float *values = p.maps.values;
    p.state.blur = 0.49;
    assert_int_equal(sdm_fit_coarse_maps_begin(&p, &fine, NULL), SDM_OK);
    assert_ptr_equal(p.maps.values, values);
    sdm_fit_coarse_maps_end(&p, &fine);
    assert_ptr_equal(p.maps.values, values);
    sdm_fit_maps_dispose(&p.maps);
    sdm_fit_samples_dispose(&p.samples);
    sdm_fit_information_dispose(&p.information);
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(coarse_maps_show_a_wide_blur)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
