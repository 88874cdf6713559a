/* Parts of the fit: derivatives against differences, bounded steps, averaged gradient, Anderson
 * acceleration, maxima.
 * Tests: anderson.c averaged_gradient.c averaged_maps.c map_fields.c newton.c objective.c rival.c
 * solve.c unknowns_cost.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/data/observation.h"
#include "fit/judge/rival.h"
#include "fit/solver/anderson.h"
#include "fit/solver/averaged_gradient.h"
#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/prior.h"
#include "fit/solver/solve.h"
#include "fit/solver/unknowns_cost.h"
#include "oracle/fit_tools.h"
#include "sdm/internal/rng.h"

// ---- observation model

static fit_observation observation_of(sdm_fit_kind kind, sdm_fit_model model, double dof)
{
    sdm_fit_opts o = sdm_fit_defaults();
    o.image_model = model;
    o.appearance.n_inside = 2;
    o.appearance.inside[1] = (sdm_fit_law){.weight = 0.5, .mean = 300, .sd = 100, .dof = dof};
    o.appearance.outside[0].dof = dof;
    const fit_state s = {.l_ref = 0.3, .point_sd = 0.2, .appearance = o.appearance};
    fit_observation obs;
    sdm_fit_observation_prepare(&o, kind, &s, &obs);
    return obs;
}

static double log_likelihood(const fit_observation *obs, double value, double field)
{
    fit_likelihood r;
    sdm_fit_likelihood(obs, value, NULL, field, false, &r);
    return r.log_likelihood;
}

static void assert_close(double found, double wanted, double scale)
{
    if (!(fabs(found - wanted) <= 1e-5 * (fabs(wanted) + scale)))
        fail_msg("%.12g, wanted %.12g", found, wanted);
}

static void check_score(const fit_observation *obs, double value, double field, double h)
{
    fit_likelihood r;
    sdm_fit_likelihood(obs, value, NULL, field, true, &r);
    assert_close(r.log_likelihood, log_likelihood(obs, value, field), 0);
    assert_close(r.score[0],
                 (log_likelihood(obs, value, field + h) - log_likelihood(obs, value, field - h)) /
                     (2 * h),
                 1e-2);
    for (size_t c = 1; c < obs->n_channels; c++) {
        fit_observation up = *obs, down = *obs;
        up.tissue[c - 1].mean += 1e-2, down.tissue[c - 1].mean -= 1e-2;
        assert_close(
            r.score[c],
            (log_likelihood(&up, value, field) - log_likelihood(&down, value, field)) / 2e-2, 1e-4);
    }
    for (size_t a = 0; a < obs->n_channels; a++)
        assert_true(r.complete[a * (obs->n_channels + 1)] >= 0);
    // Observed information is complete information minus missing information.
    assert_true(r.observed[0] <= r.complete[0]);
}

static void test_scores_match_differences(void **state)
{
    (void)state;
    for (int dof = 0; dof < 5; dof += 4) {
        const fit_observation share = observation_of(SDM_FIT_IMAGE, SDM_FIT_PARTIAL_VOLUME, dof);
        const fit_observation labels = observation_of(SDM_FIT_IMAGE, SDM_FIT_LABELS, dof);
        assert_int_equal(share.n_channels, 5);
        assert_int_equal(labels.n_channels, 1);
        for (double value = -1500; value < 2500; value += 190) {
            for (double a = -0.02; a < 1.03; a += 0.061) check_score(&share, value, a, 1e-6);
            for (double d = -2; d < 2; d += 0.31) check_score(&labels, value, d, 1e-5);
        }
    }
    const fit_observation label = observation_of(SDM_FIT_LABEL, SDM_FIT_LABELS, 0),
                          points = observation_of(SDM_FIT_POINTS, SDM_FIT_LABELS, 0);
    fit_observation outliers = points;
    outliers.outliers = 0.3, outliers.outlier_density = 0.2;
    for (double d = -2; d < 2; d += 0.31) {
        for (double u = 0; u <= 1; u += 0.25) check_score(&label, u, d, 1e-5);
        check_score(&points, 0, d, 1e-5);
        check_score(&outliers, 0, d, 1e-5);
    }
}

/* Integrals over all values of a voxel, for one pair of Gaussians: the density integrates to 1,
 * the mean score is 0, and the mean squared score is the Fisher information. */
static void test_information_of_gaussians(void **state)
{
    (void)state;
    sdm_fit_opts o = sdm_fit_defaults();
    o.appearance.n_outside = 1;
    const fit_state s = {.l_ref = 0.3, .point_sd = 0.2, .appearance = o.appearance};
    fit_observation obs;
    sdm_fit_observation_prepare(&o, SDM_FIT_IMAGE, &s, &obs);
    for (double a = 0.05; a < 1; a += 0.15) {
        double all = 0, mean = 0, square = 0, product = 0;
        fit_likelihood r = {0};
        for (double v = -3000; v < 5000; v++) {
            sdm_fit_likelihood(&obs, v, NULL, a, true, &r);
            const double p = exp(r.log_likelihood);
            all += p, mean += p * r.score[0], square += p * r.score[0] * r.score[0];
            product += p * r.score[0] * r.score[1];
        }
        assert_true(fabs(all - 1) < 1e-6 && fabs(mean) < 1e-6);
        assert_true(fabs(square / r.complete[0] - 1) < 1e-4);
        assert_true(fabs(product / r.complete[1] - 1) < 1e-4);
    }
}

// ---- bounded steps

static void test_bounded_step(void **state)
{
    (void)state;
    const double a[9] = {4, 1, 0.5, 1, 3, 0.2, 0.5, 0.2, 2}, gradient[3] = {1, -2, 3};
    fit_limits l = {.min = {-9, -9, -9}, .max = {9, 9, 9}};
    double step[3], work[18];
    assert_true(sdm_fit_bounded_step(3, a, gradient, 0, &l, step, work));
    for (int i = 0; i < 3; i++)
        assert_true(fabs(a[3 * i] * step[0] + a[3 * i + 1] * step[1] + a[3 * i + 2] * step[2] -
                         gradient[i]) < 1e-12);
    // The third unknown stops at its bound, the second is optimal given that, the first is kept.
    l.max[2] = 0.5;
    l.kept[0] = true;
    assert_true(sdm_fit_bounded_step(3, a, gradient, 0, &l, step, work));
    assert_true(step[0] == 0 && step[2] == 0.5 &&
                fabs(3 * step[1] + 0.2 * 0.5 - gradient[1]) < 1e-12);
    const double wrong[4] = {1, 2, 2, 1};
    assert_false(sdm_fit_bounded_step(2, wrong, gradient, 0,
                                      &(fit_limits){.min = {-9, -9}, .max = {9, 9}}, step, work));
}

// ---- gradient and averaged gradient against differences of the log-likelihood, for each model

static double posterior_at(fit_problem *p, const fit_state *s)
{
    p->state = *s;
    sdm_error err;
    if (sdm_fit_evaluate(p, &err)) fail_msg("%s", err.text);
    return sdm_fit_objective(p);
}

// Averaged derivatives equal the difference quotient over the averaging interval, one-sided at a
// bound, up to the curvature of the likelihood; those by the pose stay, and all of them return.
static void check_average(fit_problem *p, const fit_state *s)
{
    double found[2], before[FIT_UNKNOWNS_MAX], average[3];
    p->high[1] = s->params[1];
    (void)posterior_at(p, s);
    memcpy(before, p->information.gradient, p->information.n_unknowns * sizeof *before);
    sdm_fit_averaging_begin(p);
    (void)posterior_at(p, s);
    memcpy(average, p->information.gradient, sizeof average);
    assert_true(p->information.gradient[fit_at_rotation(3)] == before[fit_at_rotation(3)]);
    sdm_fit_averaging_end(p);
    (void)posterior_at(p, s);
    assert_memory_equal(p->information.gradient, before,
                        p->information.n_unknowns * sizeof *before);
    for (size_t k = 0; k < 3; k++) {
        const double half_width = p->half_width[k],
                     size = sqrt(p->information.complete[k * (p->information.n_unknowns + 1)]);
        // For an ellipsoid with map voxels of 0.25 mm.
        assert_true(half_width > 1e-3 && half_width < 0.03);
        for (int side = 0; side < 2; side++) {
            fit_state moved = *s;
            moved.params[k] = fmin(s->params[k] + (side ? half_width : -half_width), p->high[k]);
            (void)posterior_at(p, &moved);
            found[side] = p->information.log_likelihood;
        }
        // one-sided, the likelihood bends by half of the width on average
        const double width = k == 1 ? half_width : 2 * half_width,
                     bent = k == 1 ? 0.5 * width * size * size : 0,
                     difference = (found[1] - found[0]) / width;
        if (!(fabs(difference - average[k]) <= 5e-3 * (fabs(difference) + size) + bent))
            fail_msg("parameter %zu: %.12g, differences %.12g, size %g, bent %g", k, average[k],
                     difference, size, bent);
    }
}

static void check_gradient(sdm_fit_kind kind, sdm_fit_model model)
{
    float *v = phantom(TRUTH, &POSE, 0.5, 7);
    sdm_fit_target t = image_of(v);
    for (size_t i = 0; kind == SDM_FIT_LABEL && i < sdm_grid_count(&t.grid); i++) v[i] = v[i] < 600;
    t.kind = kind;
    sdm_fit_opts o = near_start();
    o.image_model = model;
    o.prior_rotation_sd = o.prior_translation_sd = 0.01;
    const sdm_fit_source source = exact_source();
    fit_problem p = {.source = &source,
                     .target = &t,
                     .opts = &o,
                     .n_params = 3,
                     .stride = 1,
                     .extent = {.reach = 2.5}};
    for (int k = 0; k < 3; k++) p.low[k] = 1, p.high[k] = 4;
    assert_int_equal(sdm_fit_maps_create(&source,
                                         kind == SDM_FIT_IMAGE && model == SDM_FIT_PARTIAL_VOLUME,
                                         &o, &p.maps, NULL),
                     SDM_OK);
    fit_state s = {.blur = 0.3, .l_ref = 0.2, .point_sd = 0.1, .appearance = o.appearance};
    sdm_pose_matrix(&o.start_pose, s.rotation);
    memcpy(s.translation, o.start_pose.translation, sizeof s.translation);
    memcpy(s.params, START, sizeof START);
    p.prior = p.state = s;
    p.prior.translation[1] += 0.1;
    sdm_pose_matrix(&POSE, p.prior.rotation);
    p.maps_params[0] = p.maps_blur = NAN;
    const size_t n = fit_columns(3) + (p.maps.share ? 2 : 0);
    bool changed;
    assert_int_equal(sdm_fit_information_create(n, &p.information, NULL), SDM_OK);
    const fit_region region = {.centre = {0.3, -0.2, 0.1}, .radius = 9};
    assert_int_equal(sdm_fit_samples_choose(&t, &o, &region, 1, &p.samples, &changed, NULL),
                     SDM_OK);
    assert_true(changed && p.samples.n > 5000);
    fit_region few = region;
    few.max_samples = 1000; // one more sample ends the selection
    assert_int_equal(sdm_fit_samples_choose(&t, &o, &few, 1, &p.samples, &changed, NULL), SDM_OK);
    assert_true(changed && p.samples.n == 1001);
    assert_int_equal(sdm_fit_samples_choose(&t, &o, &region, 1, &p.samples, &changed, NULL),
                     SDM_OK);
    assert_true(changed && p.samples.n > 5000);
    (void)posterior_at(&p, &s);
    double gradient[FIT_UNKNOWNS_MAX];
    memcpy(gradient, p.information.gradient, n * sizeof *gradient);
    (void)sdm_fit_prior(&p, &s, gradient, NULL, NULL);
    for (size_t k = 0; k < n; k++) {
        if (k == fit_at_blur(3) && !p.maps.share) continue;
        // The step is wide enough to average over the kinks of the likelihood.
        const double h = k >= fit_columns(3) ? 1 : k == fit_at_blur(3) ? 1e-3 : 4e-3;
        double step[FIT_UNKNOWNS_MAX] = {0}, found[2],
               size = sqrt(p.information.complete[k * (n + 1)]);
        for (int side = 0; side < 2; side++) {
            fit_state moved;
            step[k] = side ? h : -h;
            sdm_fit_state_move(&p, &s, step, &moved);
            found[side] = posterior_at(&p, &moved);
        }
        const double difference = (found[1] - found[0]) / (2 * h);
        if (!(fabs(difference - gradient[k]) < 2e-3 * fabs(difference) + 0.1 * size))
            fail_msg("unknown %zu: %g, differences %g (one sd: %g)", k, gradient[k], difference,
                     size);
    }
    check_average(&p, &s);
    sdm_fit_maps_dispose(&p.maps);
    sdm_fit_samples_dispose(&p.samples);
    sdm_fit_information_dispose(&p.information);
    free(v);
}

// The prior of parameters: about the mean and in units of the deviation of a normal one, else about
// the middle and in units of half the range. Its derivatives match differences.
static void test_prior_of_parameters(void **state)
{
    (void)state;
    enum { N = 3 };
    sdm_fit_opts o = sdm_fit_defaults();
    fit_problem p = {.opts = &o, .n_params = N};
    p.information.n_unknowns = N + 7;
    const double x[N] = {1.3, 2.7, -0.2}, low[N] = {1, 1, -3}, high[N] = {4, 4, 3};
    const double mean[N] = {2.5, 2, 0}, sd[N] = {1.5, 0.25, 1}, weight[N] = {1, 3, 1};
    p.distribution[1] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 2, 0.25};
    p.distribution[2] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0, 1};
    for (int k = 0; k < N; k++) p.low[k] = low[k], p.high[k] = high[k];
    for (int k = 0; k < N + 6; k++) p.prior_weight[k] = k < N ? weight[k] : 1;
    for (double unit = 0; unit < 2; unit += 0.5) {
        fit_state s = {0};
        double gradient[N + 7] = {0}, complete[(N + 7) * (N + 7)] = {0}, wanted = 0;
        o.prior_sd = unit;
        memcpy(s.params, x, sizeof x);
        for (int k = 0; k < N && unit > 0; k++)
            wanted -= 0.5 * weight[k] * pow((x[k] - mean[k]) / (unit * sd[k]), 2);
        const double found = sdm_fit_prior(&p, &s, gradient, complete, NULL);
        assert_true(fabs(found - wanted) <= 1e-12 * fabs(wanted));
        for (int k = 0; k < N; k++) {
            const double h = 1e-3;
            fit_state up = s, down = s;
            up.params[k] += h, down.params[k] -= h;
            const double above = sdm_fit_prior(&p, &up, NULL, NULL, NULL),
                         below = sdm_fit_prior(&p, &down, NULL, NULL, NULL);
            assert_true(fabs((above - below) / (2 * h) - gradient[k]) < 1e-7);
            assert_true(fabs((2 * found - above - below) / (h * h) - complete[k * (N + 8)]) < 1e-4);
            const double before = unit > 0 ? unit * sd[k] : (high[k] - low[k]) / sqrt(12);
            assert_true(fabs(sdm_fit_prior_sd(&p, (size_t)k) - before) < 1e-14);
        }
    }
}

// The mean values inside have Gaussians about those of the start; kept ones have none.
static void test_prior_of_means(void **state)
{
    (void)state;
    enum { N = 1, ALL = N + 7 + 3 };
    sdm_fit_opts o = sdm_fit_defaults();
    fit_problem p = {.opts = &o, .n_params = N, .low = {1}, .high = {4}};
    o.prior_sd = 0;
    o.appearance.n_inside = 2;
    o.appearance.inside[0] = (sdm_fit_law){.weight = 0.5, .mean = 40, .sd = 170};
    o.appearance.inside[1] = (sdm_fit_law){.weight = 0.5, .mean = 300, .sd = 50};
    p.information.n_unknowns = ALL;
    for (int k = 0; k < ALL; k++) p.prior_weight[k] = 1 + k;
    fit_state s = {.appearance = o.appearance};
    s.appearance.inside[0].mean = 500;
    s.appearance.inside[1].mean = 275;
    double gradient[ALL] = {0}, complete[ALL * ALL] = {0};
    const double first = 9.0 * 460 / (170 * 170), second = 10.0 * 25 / (50 * 50),
                 found = sdm_fit_prior(&p, &s, gradient, complete, NULL);
    assert_true(fabs(found + 0.5 * (first * 460 + second * 25)) < 1e-9);
    assert_true(fabs(gradient[8] + first) < 1e-12 && fabs(gradient[9] - second) < 1e-12);
    assert_true(fabs(complete[8 * ALL + 8] - 9.0 / (170 * 170)) < 1e-15);
    assert_true(gradient[10] == 0 && complete[10 * ALL + 10] == 0); // outside: none
    assert_true(sdm_fit_has_prior(&p));
    p.absent[0] = true;
    assert_true(fabs(sdm_fit_prior(&p, &s, NULL, NULL, NULL) + 0.5 * second * 25) < 1e-9);
    o.keep_appearance = true;
    assert_true(sdm_fit_prior(&p, &s, NULL, NULL, NULL) == 0 && !sdm_fit_has_prior(&p));
}

static void test_gradient_matches_differences(void **state)
{
    (void)state;
    check_gradient(SDM_FIT_IMAGE, SDM_FIT_PARTIAL_VOLUME);
    check_gradient(SDM_FIT_IMAGE, SDM_FIT_LABELS);
    check_gradient(SDM_FIT_LABEL, SDM_FIT_LABELS);
}

// ---- Anderson acceleration

// x -> fixed + A (x - fixed); A has the eigenvalues 0.99, 0.9, 0.5, -0.95 along oblique directions.
static void affine(const double *x, double *y)
{
    static const double RATE[4] = {0.99, 0.9, 0.5, -0.95};
    for (int i = 0; i < 4; i++) {
        y[i] = 1 + i + RATE[i] * (x[i] - 1 - i);
        for (int k = 0; k < i; k++) y[i] += 0.1 * (x[k] - 1 - k);
    }
}

static void test_anderson_converges_fast(void **state)
{
    (void)state;
    fit_anderson m = {0};
    double x[4] = {0.5, 2.5, 2, 4.5}, y[4], off = INFINITY;
    int steps = 0;
    for (; steps < 12 && off > 1e-9; steps++) {
        affine(x, y);
        sdm_fit_anderson_mix(&m, FIT_ANDERSON_DEPTH, 4, x, y, 100);
        off = 0;
        for (int k = 0; k < 4; k++) x[k] = y[k], off = fmax(off, fabs(x[k] - 1 - k));
    }
    // without acceleration about 2000 steps
    if (steps > 8) fail_msg("%d steps, off by %g", steps, off);

    // Acceleration changes the plain iterate by at most the given limit.
    m.count = 0;
    const double start[4] = {0, 0, 0, 0};
    memcpy(x, start, sizeof x);
    for (int i = 0; i < 6; i++) {
        double image[4];
        affine(x, image);
        memcpy(y, image, sizeof y);
        sdm_fit_anderson_mix(&m, FIT_ANDERSON_DEPTH, 4, x, y, 0.01);
        for (int k = 0; k < 4; k++) assert_true(fabs(y[k] - image[k]) <= 0.01 * (1 + 1e-12));
        memcpy(x, y, sizeof x);
    }
    // A fixed point stays fixed.
    m.count = 0;
    const double fixed[4] = {1, 2, 3, 4};
    for (int i = 0; i < 4; i++) {
        memcpy(y, fixed, sizeof y);
        sdm_fit_anderson_mix(&m, FIT_ANDERSON_DEPTH, 4, fixed, y, 1);
        assert_memory_equal(y, fixed, sizeof y);
    }
}

// ---- cost of the unknowns

// Two parameters with priors of sd 1 about 0, known to 0.1 (at 0.5) and to 0.2, or correlated; and
// one with a normal distribution that the data leave open.
static void test_unknowns_cost(void **state)
{
    (void)state;
    sdm_fit_opts o = sdm_fit_defaults();
    double params[3] = {0.5, 0, 7}, covariance[81] = {0};
    fit_problem *p = calloc(1, sizeof *p);
    assert_non_null(p);
    p->opts = &o;
    p->n_params = 3;
    for (int k = 0; k < 2; k++) p->low[k] = -1, p->high[k] = 1;
    p->low[2] = -100, p->high[2] = 100;
    p->distribution[2] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 7, 3};
    const sdm_fit_result r = {.params = params, .covariance = covariance, .n_params = 3};
    covariance[0] = 0.01, covariance[10] = 0.04, covariance[20] = 9;
    // 1e6 independent samples: an unknown costs at most log(1e6) / 2 = 6.9
    const double pose = 6 * 0.5 * log(1e6), separate = log(10) + 0.125 + log(5);
    assert_true(fabs(sdm_fit_unknowns_cost(p, &r, 1e6) - pose - separate) < 1e-9);
    // if their estimates are correlated, the cost follows from the determinant of the covariance
    covariance[1] = covariance[9] = 0.8 * 0.1 * 0.2;
    const double both = separate - 0.5 * log(1 - 0.64);
    assert_true(fabs(sdm_fit_unknowns_cost(p, &r, 1e6) - pose - both) < 1e-9);
    // few samples: none costs more than an unknown of the pose
    assert_true(fabs(sdm_fit_unknowns_cost(p, &r, 4) - (6 + 2) * 0.5 * log(4)) < 1e-9);
    // what is kept costs nothing
    o.keep_pose = true;
    o.kept = (const bool[3]){false, true, false};
    assert_true(fabs(sdm_fit_unknowns_cost(p, &r, 1e6) - log(10) - 0.125) < 1e-9);
    // singular: as much as unknowns of a pose
    covariance[0] = 0;
    assert_true(fabs(sdm_fit_unknowns_cost(p, &r, 1e6) - 2 * 0.5 * log(1e6)) < 1e-9);
    free(p);
}

// ---- maxima

// Whether a bar of 200 voxels that begins at voxel 100 and one that begins at `rival` belong to the
// same maximum, in an image of white noise with this sd that holds a bar at each of the places
// shown[n].
static bool same_maximum(double sd, size_t rival, size_t n, const size_t *shown)
{
    enum { N = 600, LENGTH = 200 };
    static float value[N];
    static double fit[N], other[N];
    const sdm_fit_opts o = sdm_fit_defaults();
    fit_state s = {.appearance = {.n_inside = 1,
                                  .n_outside = 1,
                                  .inside = {{.weight = 1, .mean = 0, .sd = sd}},
                                  .outside = {{.weight = 1, .mean = 1000, .sd = sd}}}};
    fit_problem p = {.samples = {.n = N, .value = value, .field = other}, .maps = {.share = true}};
    const sdm_fit_target target = {.kind = SDM_FIT_IMAGE};
    p.target = &target;
    sdm_fit_observation_prepare(&o, SDM_FIT_IMAGE, &s, &p.observation);
    fit_standing a = {.factor = 1}, b = {.factor = 1};
    for (size_t i = 0; i < N; i++) {
        bool in = false;
        for (size_t k = 0; k < n; k++)
            in = in || i - shown[k] < LENGTH; // unsigned: also i >= shown
        value[i] = (float)((in ? 0 : 1000) + sd * sdm_rng_normal(5, 0, i));
        fit[i] = i - 100 < LENGTH, other[i] = i - rival < LENGTH;
        a.log_likelihood += log_likelihood(&p.observation, (double)value[i], fit[i]);
        b.log_likelihood += log_likelihood(&p.observation, (double)value[i], other[i]);
    }
    return sdm_fit_same_maximum(&p, &a, fit, &b);
}

// In strong noise the bar may begin anywhere in some voxels. In weak noise two places that explain
// the image as well as each other are no maximum, as the truth lies between them, or two maxima, as
// the image holds two bars.
static void test_a_wide_maximum_is_one(void **state)
{
    (void)state;
    const size_t at_110 = 110, both[] = {100, 350};
    assert_true(same_maximum(4000, 120, 1, &at_110));
    assert_false(same_maximum(200, 120, 1, &at_110));
    assert_false(same_maximum(1000, 350, 2, both));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_unknowns_cost),
        cmocka_unit_test(test_scores_match_differences),
        cmocka_unit_test(test_information_of_gaussians),
        cmocka_unit_test(test_bounded_step),
        cmocka_unit_test(test_prior_of_parameters),
        cmocka_unit_test(test_prior_of_means),
        cmocka_unit_test(test_gradient_matches_differences),
        cmocka_unit_test(test_anderson_converges_fast),
        cmocka_unit_test(test_a_wide_maximum_is_one),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
