/* Rivals that are none, and advice that leads nowhere: a pose that differs from the fit along an
 * open direction alone, and a place from which the fit came. Tests: rival.c next_pose.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/judge/next_pose.h"
#include "fit/judge/rival.h"
#include "sdm/pose.h"

enum { PARAMS = 2, SIZE = PARAMS + 6 };
static const double PI = 3.141592653589793, REACH = 10;
static const double CENTRE[3] = {0, 0, 4};

// a state turned by `angle` about z and then by `tilt` about x, `shift` mm along x
static fit_state state_at(double angle, double tilt, double shift)
{
    const sdm_pose turn = {{0, 0, angle}, {0}}, lean = {{tilt, 0, 0}, {shift, 0, 0}},
                   pose = sdm_pose_compose(&lean, &turn);
    fit_state s = {.params = {5, 7}};
    sdm_pose_matrix(&pose, s.rotation);
    memcpy(s.translation, pose.translation, sizeof s.translation);
    return s;
}

// a fit whose pose and parameters are known to 0.02, but for `sd_z`: rotation about z
static void check_openly(double sd_z, const fit_state *rival, bool openly)
{
    double c[SIZE * SIZE] = {0}, sd[SIZE];
    bool by_prior[PARAMS] = {false};
    sdm_fit_result r = {.n_params = PARAMS, .covariance = c, .sd = sd, .by_prior = by_prior};
    fit_problem *p = calloc(1, sizeof *p);
    assert_non_null(p);
    for (size_t i = 0; i < SIZE; i++) sd[i] = i == PARAMS + 2 ? sd_z : 0.02;
    for (size_t i = 0; i < SIZE; i++) c[i * (SIZE + 1)] = sd[i] * sd[i];
    p->n_params = PARAMS, p->extent.reach = REACH;
    const fit_state fitted = state_at(0, 0, 0);
    assert_int_equal(sdm_fit_differs_openly(p, &r, &fitted, rival, CENTRE), openly);
    free(p);
}

static void turns_about_an_open_axis_are_no_rivals(void **state)
{
    (void)state;
    const double any = PI / sqrt(3); // of an angle that may be any
    const fit_state half = state_at(PI, 0, 0), leaning = state_at(PI, 0.05, 0),
                    over = state_at(0, PI, 0), tilted = state_at(2, 0.4, 0),
                    aside = state_at(PI, 0, 3);
    fit_state larger = state_at(PI, 0, 0);
    larger.params[1] = 8;
    check_openly(any, &half, true);
    check_openly(0.7, &half, true);
    check_openly(any, &leaning, true);
    check_openly(0.1, &half, false);
    check_openly(any, &over, false);
    check_openly(any, &tilted, false);
    check_openly(any, &aside, false);
    check_openly(any, &larger, false);
    check_openly(NAN, &half, false);
}

static void a_fit_is_not_sent_where_it_began(void **state)
{
    (void)state;
    fit_problem *p = calloc(1, sizeof *p);
    assert_non_null(p);
    p->n_params = PARAMS, p->extent.reach = REACH;
    const fit_state fitted = state_at(0, 0, 0);
    fit_state rival = state_at(PI, 0, 1);
    rival.params[1] = 9;
    // from the fitted values, in the fitted pose
    p->prior = p->begun[0] = fitted, p->n_begun = 1;
    assert_false(sdm_fit_began_at(p, &fitted, &rival, 2, CENTRE));
    assert_false(sdm_fit_began_at(p, &fitted, &rival, 0, CENTRE));
    // -p with the value that was advised, rounded
    p->prior.params[1] = 8.95;
    assert_true(sdm_fit_began_at(p, &fitted, &rival, 2, CENTRE));
    assert_false(sdm_fit_began_at(p, &fitted, &rival, 1, CENTRE));
    assert_false(sdm_fit_began_at(p, &fitted, &rival, 0, CENTRE));
    // a restart in the pose that was advised
    p->prior = fitted;
    p->begun[1] = state_at(PI - 0.1, 0.05, 0.9), p->n_begun = 2;
    assert_true(sdm_fit_began_at(p, &fitted, &rival, 0, CENTRE));
    assert_false(sdm_fit_began_at(p, &fitted, &rival, 2, CENTRE));
    free(p);
}

static void a_start_that_lost_is_not_advised(void **state)
{
    (void)state;
    static const char *const advice[] = {"start from this value (sdm_fit_opts.start_params)",
                                         "start from this pose, or try more turns"};
    for (size_t i = 0; i < 2; i++) {
        sdm_fit_verdict v = {.n_findings = 2};
        v.findings[0].kind = SDM_FIT_CHECK_RESIDUALS;
        v.findings[1].kind = SDM_FIT_CHECK_NEXT_POSE;
        for (size_t k = 0; k < 2; k++)
            snprintf(v.findings[k].text, sizeof v.findings[k].text, "it explains more: %s",
                     advice[i]);
        sdm_fit_next_pose_tried(&v);
        assert_non_null(strstr(v.findings[0].text, advice[i]));
        assert_string_equal(v.findings[1].text, "it explains more: a fit that began there did not "
                                                "stay: keep what is known (sdm_fit_opts.kept)");
    }
}

/* Points that scatter farther about another shape excuse it: its neighbourhoods deviate by less of
 * their own noise. It is no better explanation unless it is likelier. */
static void a_rival_of_points_needs_the_likelihood(void **state)
{
    (void)state;
    const fit_standing fit = {
        .log_likelihood = 300, .factor = 1, .n_units = 64, .chi_square = 0.6, .n_points = 250};
    fit_standing rival = fit;
    rival.log_likelihood = 178, rival.chi_square = 0.3;
    assert_true(fabs(sdm_fit_gain(&fit, &rival) - (300 - 178)) < 1e-9);
    // a little less likely after few iterations: as good
    rival.log_likelihood = 290;
    assert_true(fabs(sdm_fit_gain(&fit, &rival)) < 1e-9);
    // better by both: half of 64 neighbourhoods times log 2
    rival.log_likelihood = 400;
    assert_true(fabs(sdm_fit_gain(&fit, &rival) - (-32 * log(2))) < 1e-9);
    // labels have no likelihood
    fit_standing labels = fit, others = rival;
    labels.factor = others.factor = 0;
    assert_true(fabs(sdm_fit_gain(&labels, &others) - (-32 * log(2))) < 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(turns_about_an_open_axis_are_no_rivals),
                                       cmocka_unit_test(a_fit_is_not_sent_where_it_began),
                                       cmocka_unit_test(a_rival_of_points_needs_the_likelihood),
                                       cmocka_unit_test(a_start_that_lost_is_not_advised)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
