/* Fits to phantoms with known truth: accuracy, and whether the standard deviations match the
 * errors.
 * Tests: fit.c fit_check.c fit_map.c newton.c observation.c prior.c score_covariance.c
 * start_search.c tissues.c unknowns_cost.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"

// Largest error of parameters (mm), rotation (rad) and translation (mm).
static double largest_error(const sdm_fit_result *r)
{
    double e[9], most = 0;
    errors(r, TRUTH, &POSE, e);
    for (int k = 0; k < 9; k++) most = fmax(most, fabs(e[k]));
    return most;
}

static void test_estimate_without_noise(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0, 1);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_opts o = near_start();
    sdm_fit_result r = fit(&t, &o);
    assert_true(r.converged && r.n_params == 3 && r.n_exact > 3 && r.n_network == 0);
    if (!(largest_error(&r) < 4e-3)) fail_msg("off by %g", largest_error(&r));
    // The fitted blur includes the extent of a voxel (variance h^2 / 12); the means are the
    // phantom's.
    assert_true(fabs(r.blur - sqrt(0.04 + 0.0625 / 12)) < 0.01);
    assert_true(fabs(r.appearance.inside[0].mean - 40) < 5 &&
                fabs(r.appearance.outside[0].mean - 1300) < 5);
    assert_true(r.evidence > 0 && r.log_likelihood > r.log_likelihood_without &&
                r.inside_share == 1);
    assert_true(r.n_iterations > 1 && r.objective[r.n_iterations - 1] < 0);

    // Another start leads to the same estimate.
    sdm_fit_opts other = o;
    other.start_pose = POSE;
    other.start_params = TRUTH;
    sdm_fit_result b = fit(&t, &other);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(r.params[k] - b.params[k]) < 3e-5);
        assert_true(fabs(r.pose.rotation[k] - b.pose.rotation[k]) < 3e-5);
        assert_true(fabs(r.pose.translation[k] - b.pose.translation[k]) < 3e-5);
    }
    sdm_fit_dispose(&r);
    sdm_fit_dispose(&b);
    free(v);
}

// With noise, and kinks in the likelihood: fits from two starts reach the same maximum.
static void starts_reach_one_maximum(uint64_t first, uint64_t end)
{
    double most = 0;
    for (uint64_t seed = first; seed < end; seed++) {
        float *v = phantom(TRUTH, &POSE, 1, seed);
        const sdm_fit_target t = image_of(v);
        sdm_fit_opts o = near_start();
        sdm_fit_result a = fit(&t, &o);
        o.start_pose = POSE;
        o.start_params = (const double[3]){2.6, 1.7, 1.2};
        sdm_fit_result b = fit(&t, &o);
        assert_true(a.converged && b.converged);
        for (int k = 0; k < 3; k++) {
            most = fmax(most, fabs(a.params[k] - b.params[k]) / 3); // relative to the range 3
            most = fmax(most, fabs(a.pose.rotation[k] - b.pose.rotation[k]));
            most = fmax(most, fabs(a.pose.translation[k] - b.pose.translation[k]) / 2.5);
        }
        sdm_fit_dispose(&a);
        sdm_fit_dispose(&b);
        free(v);
    }
    printf("two starts end %.2g apart\n", most);
    assert_true(most < 1e-5);
}

static void test_starts_reach_one_maximum(void **state)
{
    (void)state;
    starts_reach_one_maximum(20, 21);
}

static void test_starts_reach_one_maximum_long(void **state)
{
    (void)state;
    starts_reach_one_maximum(21, 22);
}

// n fits to noisy phantoms: of one shape with different noise, or (random) of different shapes and
// poses. *rms: root mean square of error / sd. *beyond: number of parameters whose error exceeds 3
// sd.
static void errors_over_sd(size_t n, bool random, double *rms, size_t *beyond)
{
    double square = 0;
    size_t count = 0;
    *beyond = 0;
    for (size_t i = 0; i < n; i++) {
        double p[3], start[3], e[9];
        sdm_pose pose = POSE;
        sdm_fit_opts o = near_start();
        for (size_t k = 0; k < 3; k++) {
            p[k] = TRUTH[k] + (random ? 0.6 * sdm_rng_uniform(5, i, k) - 0.3 : 0);
            start[k] = fmax(p[k] + 0.3 * sdm_rng_uniform(6, i, k) - 0.15, 1.02);
        }
        if (random) pose = sdm_phantom_random_pose(0.5, 0.3, 1000 + i);
        float *v = phantom(p, &pose, 1, 10 + i);
        const sdm_fit_target t = image_of(v);
        o.start_params = start;
        o.start_pose = sdm_pose_compose(&(sdm_pose){{0.05, 0.05, -0.05}, {0.1, 0.1, -0.1}}, &pose);
        sdm_fit_result r = fit(&t, &o);
        errors(&r, p, &pose, e);
        for (size_t k = 0; k < 9; k++) {
            const double z = e[k] / r.sd[k];
            square += z * z;
            count++;
            if (k < 3 && fabs(z) > 3) (*beyond)++;
        }
        sdm_fit_dispose(&r);
        free(v);
    }
    *rms = sqrt(square / (double)count);
}

static size_t n_random = 0;

static void test_sd_match_the_errors(void **state)
{
    (void)state;
    double rms;
    size_t beyond;
    const size_t n = n_random ? n_random : 6;
    errors_over_sd(n, n_random > 0, &rms, &beyond);
    printf("errors over standard deviations: root mean square %.2f; %zu parameters beyond 3\n", rms,
           beyond);
    assert_true(rms > 0.6 && rms < 1.5);
    assert_true((double)beyond <= 0.05 * (double)n);
}

static void test_same_bits_for_threads(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 3);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.n_threads = 1;
    sdm_fit_result one = fit(&t, &o);
    o.n_threads = 3;
    sdm_fit_result r = fit(&t, &o);
    assert_memory_equal(r.params, one.params, 3 * sizeof *r.params);
    assert_memory_equal(&r.pose, &one.pose, sizeof r.pose);
    assert_memory_equal(r.covariance, one.covariance, 81 * sizeof *r.covariance);
    assert_int_equal(r.n_iterations, one.n_iterations);
    sdm_fit_dispose(&r);
    sdm_fit_dispose(&one);
    free(v);
}

static void test_fit_by_label_model(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0.3, 3);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.image_model = SDM_FIT_LABELS;
    sdm_fit_result r = fit(&t, &o);
    // This model is biased: it puts the edge where the two densities are equal, not at the surface.
    if (!(largest_error(&r) < 0.25)) fail_msg("off by %g", largest_error(&r));
    assert_true(r.blur == 0 && r.evidence > 0);
    sdm_fit_dispose(&r);
    free(v);
}

static void test_fit_to_label_map(void **state)
{
    (void)state;
    const sdm_fit_source source = exact_source();
    const sdm_grid g = image_grid();
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    if (!v) abort();
    assert_int_equal(sdm_fit_map(&source, TRUTH, &POSE, &g, 1, v, NULL), SDM_OK);
    // Against the closed form; the mesh lies slightly inside of the ellipsoid.
    for (size_t i = 0; i < sdm_grid_count(&g); i += 37) {
        const double index[3] = {(double)(i % 36), (double)(i / 36 % 30), (double)(i / 36 / 30)};
        double x[3], y[3], d;
        sdm_grid_world(&g, index, x);
        sdm_pose_apply_inverse(&POSE, x, y);
        assert_int_equal(sdm_instance_distance(ellipsoid, TRUTH, y, &d, NULL), SDM_OK);
        if (fabs(d) < 0.8) assert_true(fabs((double)v[i] - d) < 0.02);
    }
    for (size_t i = 0; i < sdm_grid_count(&g); i++) v[i] = v[i] < 0;
    sdm_fit_target t = image_of(v);
    t.kind = SDM_FIT_LABEL;
    const sdm_fit_opts o = near_start();
    sdm_fit_result r = fit(&t, &o);
    if (!(largest_error(&r) < 0.02)) fail_msg("off by %g", largest_error(&r));
    assert_true(isnan(r.evidence));
    sdm_fit_dispose(&r);
    // If the logistic prior did not blur the distance, it would shorten the long axis by 0.035 mm.
    sdm_fit_opts logistic = o;
    logistic.image_model = SDM_FIT_LABELS;
    logistic.l_ref = 0.1;
    r = fit(&t, &logistic);
    if (!(largest_error(&r) < 0.02)) fail_msg("off by %g", largest_error(&r));
    assert_true(isnan(r.evidence) && r.blur == 0);
    sdm_fit_dispose(&r);
    v[0] = 2;
    sdm_error err;
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_FORMAT);
    assert_non_null(strstr(err.text, "labels from 0 to 2"));
    free(v);
}

static void test_default_lengths(void **state)
{
    (void)state;
    const sdm_fit_opts o = sdm_fit_defaults();
    for (double voxel = 0.1; voxel < 1; voxel *= 2) {
        const sdm_fit_opts d = sdm_fit_defaults_for(voxel);
        assert_true(d.blur == o.blur && d.l_ref == o.l_ref && d.margin == o.margin &&
                    d.tissue_mm == o.tissue_mm && d.point_sd == o.point_sd);
    }
    const sdm_fit_opts large = sdm_fit_defaults_for(3), small = sdm_fit_defaults_for(0.01);
    assert_true(large.blur == 0.75 && large.margin == 4.5 && large.tissue_mm == 3 &&
                large.point_sd == 0.375);
    assert_true(small.blur == 0.02 && small.margin == 0.15 && small.tissue_mm == 0.1 &&
                small.point_sd == 0.01);
}

static void test_fit_to_points(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    assert_int_equal(sdm_instance_mesh(ellipsoid, TRUTH, &m, NULL), SDM_OK);
    double *x = calloc(3 * m.n_vert, sizeof *x);
    if (!x) abort();
    for (size_t i = 0; i < m.n_vert; i++) {
        sdm_pose_apply(&POSE, m.vert + 3 * i, x + 3 * i);
        // Every 20th point is an outlier.
        const double far = i % 20 == 0 ? 0.8 : 0.01;
        for (size_t k = 0; k < 3; k++) x[3 * i + k] += far * sdm_rng_normal(1, i, k);
    }
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = x, .n_points = m.n_vert};
    sdm_fit_opts o = near_start();
    o.point_dof = 2;
    sdm_fit_result r = fit(&t, &o);
    if (!(largest_error(&r) < 0.01)) fail_msg("off by %g", largest_error(&r));
    assert_true(r.point_sd > 0.003 && r.point_sd < 0.03 && r.n_used == m.n_vert &&
                r.inside_share == 1);
    double e[9];
    errors(&r, TRUTH, &POSE, e);
    for (int k = 0; k < 9; k++) assert_true(fabs(e[k]) < 5 * r.sd[k]);
    sdm_fit_dispose(&r);
    free(x);
    sdm_mesh_dispose(&m);
}

/* What progress() was told of a search: highest numbers of starts by round, and whether start,
 * round and best start were always as documented. */
typedef struct search_log {
    size_t start[3], n_starts[3], calls_after, rivals;
    bool fits;
} search_log;

static void log_search(void *user, const sdm_fit_progress *p)
{
    search_log *log = user;
    if (p->phase == SDM_FIT_JUDGE && p->n_starts) { // rivals come in order
        log->fits = log->fits && p->start == ++log->rivals && p->start <= p->n_starts;
        return;
    }
    if (p->round == 0 || p->round > 2) {
        log->calls_after += p->phase != SDM_FIT_SEARCH && log->start[2] > 0;
        log->fits = log->fits && p->start == 0 && p->n_starts == 0;
        return;
    }
    // starts come in order, round 2 after round 1, and the first of a round knows no best one
    log->fits = log->fits && p->phase == SDM_FIT_SEARCH && p->start >= log->start[p->round] &&
                p->start <= log->start[p->round] + 1 && (p->round == 2 || !log->start[2]) &&
                (p->best_params != NULL) == (p->start > 1);
    log->start[p->round] = p->start;
    log->n_starts[p->round] = p->n_starts;
}

static void test_turned_starts_find_the_truth(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 4);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    // The start is rotated by pi / 2 about the shape's z: local steps do not lead from there to the
    // truth.
    o.start_pose = sdm_pose_compose(&POSE, &(sdm_pose){{0, 0, 1.5707963267948966}, {0, 0, 0}});
    o.start_params = TRUTH;
    o.turns = SDM_FIT_TURNS_AXIS;
    o.n_turns = 8;
    search_log log = {.fits = true};
    o.progress = log_search;
    o.user = &log;
    sdm_fit_result r = fit(&t, &o);
    assert_true(log.fits && log.calls_after > 0 && log.rivals >= 3);
    assert_true(log.start[1] == 8 && log.n_starts[1] == 8);
    assert_true(log.start[2] == log.n_starts[2] && log.start[2] >= 1 && log.start[2] <= 4);
    o.progress = NULL;
    // Turns next to the right one lead there, too. A rotation by pi gives the same ellipsoid, one
    // by pi / 2 exchanges its axes.
    assert_true(r.turn % 4 != 0);
    for (int k = 0; k < 3; k++) assert_true(fabs(r.params[k] - TRUTH[k]) < 5 * r.sd[k]);
    sdm_fit_dispose(&r);
    // The prior is centred on each rotated start. With a pivot off the origin, the rotation also
    // moves the origin.
    o.pivot[0] = 2;
    // This translation keeps the pivot in place.
    o.start_pose = sdm_pose_compose(&POSE, &(sdm_pose){{0, 0, 1.5707963267948966}, {2, -2, 0}});
    o.prior_rotation_sd = 0.03;
    o.prior_translation_sd = 0.1;
    r = fit(&t, &o);
    assert_int_equal(r.turn, 6);
    if (!(largest_error(&r) < 0.1)) fail_msg("off by %g", largest_error(&r));
    sdm_fit_dispose(&r);
    o.pivot[0] = o.prior_rotation_sd = o.prior_translation_sd = 0;
    o.turns = SDM_FIT_TURNS_SPHERE;
    o.n_turns = 16;
    o.start_pose = sdm_pose_compose(&POSE, &(sdm_pose){{1.1, 0.7, -0.8}, {0, 0, 0}});
    r = fit(&t, &o);
    // The axes may be permuted, which is the same ellipsoid.
    for (int k = 0; k < 3; k++) {
        double nearest = INFINITY;
        for (int i = 0; i < 3; i++) nearest = fmin(nearest, fabs(r.params[i] - TRUTH[k]) / r.sd[i]);
        assert_true(nearest < 5);
    }
    sdm_fit_dispose(&r);
    free(v);
}

static double cost_of_an_unknown(const sdm_fit_result *r)
{
    return 0.5 * log((double)r->n_used / fmax(r->noise_factor, 1)); // Schwarz 1978
}

// What the parameters cost the evidence, beside n_pose unknowns of the pose.
static double params_cost(const sdm_fit_result *r, double n_pose)
{
    return (r->log_likelihood - r->log_likelihood_without) / fmax(r->noise_factor, 1) -
           r->evidence - n_pose * cost_of_an_unknown(r);
}

// The same by Laplace's method, for the half axes of the ellipsoid, whose priors are as wide as
// half of their ranges; kept: index of a parameter that is kept, or 3.
static double params_cost_expected(const sdm_fit_result *r, size_t kept)
{
    const double mean[3] = {3, 2.5, 2.5}, sd[3] = {2, 1.5, 1.5};
    double m[3][3], cost = 0, before = 1;
    for (size_t i = 0; i < 3; i++)
        for (size_t j = 0; j < 3; j++)
            m[i][j] = i != kept && j != kept ? r->covariance[i * 9 + j] / (sd[i] * sd[j]) : i == j;
    const double minor = m[0][0] * m[1][1] - m[0][1] * m[1][0],
                 whole = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]),
                 determinant[3] = {m[0][0], minor, whole};
    for (size_t i = 0; i < 3; before = determinant[i++]) {
        const double off = (r->params[i] - mean[i]) / sd[i],
                     variance = determinant[i] / before; // where those before it are known
        if (i == kept) continue;
        cost += fmin(0.5 * off * off - 0.5 * log(variance), cost_of_an_unknown(r));
    }
    return cost;
}

static void test_kept_unknowns_stay(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0, 4);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.keep_params = true;
    o.start_params = TRUTH;
    sdm_fit_result r = fit(&t, &o);
    assert_memory_equal(r.params, TRUTH, sizeof TRUTH);
    assert_true(largest_error(&r) < 4e-3 && r.sd[0] == 0 && r.sd[3] > 0 && r.correlation[1] == 0);
    assert_true(fabs(params_cost(&r, 6)) < 1e-6);
    sdm_fit_dispose(&r);
    o.keep_params = false;
    // one of the parameters
    const double one[3] = {START[0], TRUTH[1], START[2]};
    o.start_params = one;
    o.kept = (const bool[3]){false, true, false};
    r = fit(&t, &o);
    assert_true(r.params[1] == TRUTH[1] && r.sd[1] == 0 && !r.at_bound[1] && !r.by_prior[1]);
    assert_true(largest_error(&r) < 4e-3 && r.sd[0] > 0 && r.sd[3] > 0);
    assert_true(fabs(params_cost(&r, 6) - params_cost_expected(&r, 1)) < 1e-6);
    sdm_fit_dispose(&r);
    o.kept = NULL;
    o.keep_pose = true;
    o.start_params = START;
    o.start_pose = POSE;
    r = fit(&t, &o);
    assert_true(largest_error(&r) < 4e-3 && r.sd[0] > 0 && r.sd[3] == 0);
    assert_true(fabs(params_cost(&r, 0) - params_cost_expected(&r, 3)) < 1e-6);
    sdm_fit_dispose(&r);
    free(v);
}

// A strong prior overrules the image, and standard deviations are at most the prior's.
static void test_priors(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.prior_translation_sd = 1e-5;
    o.prior_rotation_sd = 1e-5;
    o.tolerance = 1; // the prior holds the shape beside the one in the image
    sdm_fit_result r = fit(&t, &o);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(r.pose.translation[k] - o.start_pose.translation[k]) < 1e-3);
        assert_true(fabs(r.pose.rotation[k] - o.start_pose.rotation[k]) < 1e-3);
        assert_true(r.sd[3 + k] < 2e-5 && r.sd[6 + k] < 2e-5);
    }
    sdm_fit_dispose(&r);
    // A prior sd of 0.2 (in units of half the range 1 .. 4) pulls the parameters towards 2.5 and
    // reduces their sd.
    // A prior sd of 0.2 half ranges (1 .. 4) pulls the parameters towards 2.5 and reduces their sd.
    o.prior_translation_sd = o.prior_rotation_sd = 0;
    const sdm_fit_result free_of_it = fit(&t, &o);
    o.prior_sd = 0.2;
    r = fit(&t, &o);
    assert_true(r.params[2] > free_of_it.params[2] + 1e-4);
    assert_true(r.params[1] > free_of_it.params[1] + 1e-4);
    for (int k = 0; k < 3; k++) assert_true(r.sd[k] < 0.3 && r.sd[k] < 1.1 * free_of_it.sd[k]);
    for (int k = 0; k < 3; k++) assert_false(r.by_prior[k] || free_of_it.by_prior[k]);
    sdm_fit_result other = free_of_it;
    sdm_fit_dispose(&other);
    sdm_fit_dispose(&r);
    free(v);
}

static void nothing_is_normal(const void *self, sdm_distribution *out)
{
    (void)self;
    out[3] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 2.25, 0.125};
}

// The sd of a parameter without effect is that of its prior or of its range, and by_prior marks
// this parameter only. With a normal distribution its estimate and its sd are those of the
// distribution.
static void test_parameter_without_effect(void **state)
{
    (void)state;
    sdm_param params[4] = {{0}};
    sdm_shape shape = *sdm_instance_shape(ellipsoid);
    memcpy(params, shape.params, 3 * sizeof *params);
    params[3] = (sdm_param){
        .name = "nothing", .unit = "", .min = 1, .max = 3, .def = 1.5, .help = "has no effect"};
    shape.name = "with_nothing";
    shape.params = params;
    shape.n_params = 4;
    shape.velocity = NULL; // the callback would write only three parameters
    sdm_shape normal = shape;
    normal.distributions = nothing_is_normal;
    sdm_instance *instance[2] = {NULL, NULL};
    for (int k = 0; k < 2; k++)
        assert_int_equal(sdm_instance_create(k ? &normal : &shape, &(sdm_named_text){"edge", "0.2"},
                                             1, NULL, &instance[k], NULL),
                         SDM_OK);
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_source source = exact_source();
    for (int prior = 0; prior < 3; prior++) {
        const bool is_normal = prior == 2;
        sdm_fit_opts o = near_start();
        sdm_fit_result r;
        sdm_error err = {0};
        o.start_params = (const double[4]){2.4, 1.8, 1.4, 1.5};
        o.prior_sd = prior;
        if (is_normal) o.prior_sd = 1;
        source.shape = instance[is_normal];
        if (sdm_fit(&source, &t, &o, &r, &err)) fail_msg("%s", err.text);
        for (int k = 0; k < 3; k++) assert_false(r.by_prior[k]);
        assert_true(r.by_prior[3]);
        const double sd = is_normal ? 0.125 : prior ? 1 : 2 / sqrt(12);
        assert_true(fabs(r.sd[3] / sd - 1) < 0.02);
        if (is_normal) assert_true(fabs(r.params[3] - 2.25) < 1e-4);
        sdm_fit_dispose(&r);
    }
    for (int k = 0; k < 2; k++) sdm_instance_free(instance[k]);
    free(v);
}

// With correlated noise the prior is weighted such that estimate and prior combine by their
// variances.
static void test_prior_weight(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.keep_pose = true;
    o.start_pose = POSE;
    o.prior_sd = 0;
    sdm_fit_result r = fit(&t, &o);
    const double sd = r.sd[2], found = r.params[2], prior_sd = 10 * sd;
    assert_true(r.noise_factor > 3);
    sdm_fit_dispose(&r);
    o.prior_sd = prior_sd / 1.5; // the unit of prior_sd is half the range 1 .. 4
    r = fit(&t, &o);
    const double wanted = (2.5 - found) / (1 + prior_sd * prior_sd / (sd * sd)),
                 moved = r.params[2] - found;
    if (!(moved > 0.6 * wanted && moved < 1.6 * wanted))
        fail_msg("moved by %g, wanted %g", moved, wanted);
    sdm_fit_dispose(&r);
    free(v);
}

// Two overlapping tissues outside: 51 iterations without Anderson acceleration.
static void test_overlapping_tissues(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0.5, 6);
    const size_t n = sdm_grid_count(&(sdm_grid){.n = {36, 30, 26}});
    for (size_t i = 0; i < n; i++)
        if (v[i] > 900 && sdm_rng_uniform(8, 1, i) < 0.35)
            v[i] = (float)(700 + 400 * sdm_rng_normal(8, 2, i));
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.tolerance = 1; // the voxels above are not blurred: near the surface they are not noise
    o.appearance.n_outside = 2;
    sdm_fit_result r = fit(&t, &o);
    const sdm_fit_law *second = &r.appearance.outside[1];
    printf("overlapping tissues: %zu iterations, %s; %g of %g +- %g\n", r.n_iterations, r.reason,
           second->weight, second->mean, second->sd);
    if (!(r.n_iterations <= 40)) fail_msg("%zu iterations", r.n_iterations);
    assert_true(fabs(second->weight - 0.35) < 0.1 && fabs(second->mean - 700) < 100 &&
                fabs(second->sd - 400) < 80);
    sdm_fit_dispose(&r);
    free(v);
}

// A tissue that does not occur in the image keeps its mean and sd; it must not model something
// else.
static void test_absent_tissue_is_kept(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 4);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start(), one = near_start();
    o.appearance.n_outside = 2;
    const sdm_fit_law *air = &o.appearance.outside[1];
    sdm_fit_result r = fit(&t, &o), alone = fit(&t, &one);
    const sdm_fit_law *found = &r.appearance.outside[1];
    if (!(found->mean == air->mean && fabs(found->sd / air->sd - 1) < 1e-9 && found->weight < 1e-4))
        fail_msg("%g of %g +- %g", found->weight, found->mean, found->sd);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(r.params[k] - alone.params[k]) < 1e-2 * alone.sd[k]);
    sdm_fit_dispose(&r);
    sdm_fit_dispose(&alone);
    free(v);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_estimate_without_noise),
        cmocka_unit_test(test_starts_reach_one_maximum),
        cmocka_unit_test(test_sd_match_the_errors),
        cmocka_unit_test(test_same_bits_for_threads),
        cmocka_unit_test(test_fit_to_label_map),
        cmocka_unit_test(test_default_lengths),
        cmocka_unit_test(test_fit_to_points),
        cmocka_unit_test(test_fit_by_label_model),
        cmocka_unit_test(test_turned_starts_find_the_truth),
        cmocka_unit_test(test_kept_unknowns_stay),
        cmocka_unit_test(test_priors),
        cmocka_unit_test(test_parameter_without_effect),
        cmocka_unit_test(test_prior_weight),
        cmocka_unit_test(test_overlapping_tissues),
        cmocka_unit_test(test_absent_tissue_is_kept),
    };
    const struct CMUnitTest longer[] = {cmocka_unit_test(test_sd_match_the_errors),
                                        cmocka_unit_test(test_starts_reach_one_maximum_long)};
    n_random = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : 0;
    return n_random ? cmocka_run_group_tests(longer, set_up, tear_down)
                    : cmocka_run_group_tests(tests, set_up, tear_down);
}
