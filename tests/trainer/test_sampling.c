/* Error-driven sampling: regression of the error, density of the planned samples, and the same bits
 * for any number of threads and after a resume.
 * Tests: error_model.c sample_plan.c sampling.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "data/error_model.h"
#include "data/sample_plan.h"
#include "data/streams.h"
#include "sdm/internal/sampling.h"
#include "train_tools.h"

static double uniform(size_t i, double low, double high)
{
    // Multiples of the golden ratio modulo 1 are evenly spread.
    const double u = fmod(0.618033988749895 * (double)(i + 1), 1);
    return low + (high - low) * u;
}

static double quadratic(const double *x)
{
    return 1 + 0.5 * x[0] - 2 * x[1] * x[2] + 3 * x[2] * x[2];
}

static void regression_finds_a_polynomial(void **state)
{
    (void)state;
    enum { N = 2000, P = 3 };
    static double x[N * P], value[N];
    for (size_t i = 0; i < N; i++) {
        x[i * P] = uniform(i, -1, 1), x[i * P + 1] = uniform(7 * i + 3, -1, 1),
              x[i * P + 2] = uniform(31 * i, -1, 1);
        value[i] = quadratic(x + i * P);
    }
    error_model m;
    assert_int_equal(trainer_error_model_fit(&m, P, N, x, value, NULL), SDM_OK);
    assert_true(m.degree >= 2);
    for (size_t i = 0; i < 50; i++) {
        const double at[P] = {uniform(i, -0.9, 0.9), uniform(5 * i, -0.9, 0.9),
                              uniform(11 * i, -0.9, 0.9)};
        assert_true(fabs(trainer_error_model_at(&m, at) - quadratic(at)) < 0.05);
    }
    trainer_error_model_dispose(&m);
    // Three observations are too few for slopes: a constant, which the prior (one observation of 0)
    // reduces to 1.5.
    assert_int_equal(trainer_error_model_fit(&m, P, 3, x, (const double[]){2, 2, 2}, NULL), SDM_OK);
    assert_int_equal(m.degree, 0);
    assert_true(fabs(trainer_error_model_at(&m, x) - 1.5) < 1e-6);
    trainer_error_model_dispose(&m);
    assert_int_equal(trainer_error_model_fit(&m, P, 0, x, value, NULL), SDM_OK);
    assert_true(trainer_error_model_at(&m, x) == 0);
    trainer_error_model_dispose(&m);
}

static const double LOW[2] = {-3, 10}, HIGH[2] = {5, 11};
static const sdm_distribution UNIFORM[2];
static const sample_space space = {
    .n_params = 2, .min = LOW, .max = HIGH, .distribution = UNIFORM, .seed = 5};

// Parameters of planned sample i, scaled to -1 .. 1.
static void sample_scaled(const sample_plan *p, size_t i, double *x)
{
    sdm_sample_params(space.seed, STREAM_TRAIN, trainer_sample_plan_point(p, i), LOW, HIGH, UNIFORM,
                      2, x);
    for (int k = 0; k < 2; k++) x[k] = 2 * (x[k] - LOW[k]) / (HIGH[k] - LOW[k]) - 1;
}

// Reports errors for samples first .. first + n - 1: proportional to exp(2 x), and falling with the
// number of samples.
static void errors_report(sample_plan *p, size_t first, size_t n)
{
    double error[SAMPLE_ROUND];
    for (size_t i = 0; i < n; i++) {
        double x[2];
        sample_scaled(p, first + i, x);
        error[i] = exp(2 * x[0]) / (double)(first + 1);
    }
    trainer_sample_plan_observe(p, first, n, error);
}

static void plan_run(sample_plan *p, size_t n_start, size_t from)
{
    for (size_t at = from; at < p->n; at += SAMPLE_ROUND) {
        const size_t n = p->n - at < SAMPLE_ROUND ? p->n - at : SAMPLE_ROUND;
        assert_true(p->n_planned >= at + n);
        errors_report(p, at, n);
        assert_int_equal(trainer_sample_plan_extend(p, &space, n_start, at + n, NULL), SDM_OK);
    }
}

static void density_follows_the_error(void **state)
{
    (void)state;
    enum { START = 100, N = 20000, BINS = 4 };
    sample_plan p;
    assert_int_equal(trainer_sample_plan_create(&p, true, N, NULL), SDM_OK);
    trainer_sample_plan_start(&p, START);
    assert_int_equal(p.n_planned, START + 2 * SAMPLE_ROUND);
    for (size_t i = 0; i < p.n_planned; i++) assert_int_equal(trainer_sample_plan_point(&p, i), i);
    plan_run(&p, START, START);
    assert_int_equal(p.n_planned, N);

    double count[2][BINS] = {{0}}, all = 0;
    for (size_t i = START + 1000; i < N; i++) {
        double x[2];
        sample_scaled(&p, i, x);
        assert_true(p.point[i] > p.point[i - 1]);
        for (int k = 0; k < 2; k++) count[k][(int)(0.5 * BINS * (x[k] + 1))]++;
        all++;
    }
    for (int b = 0; b < BINS; b++) {
        // Expected share of the bin: half uniform, half proportional to exp(2 x), whose mean over
        // -1 .. 1 is sinh(2) / 2.
        const double low = -1 + 2.0 * b / BINS, high = low + 2.0 / BINS;
        const double share = 0.5 / BINS + 0.5 * (exp(2 * high) - exp(2 * low)) / 4 / (sinh(2) / 2);
        assert_true(fabs(count[0][b] / all - share) < 0.015);
        assert_true(fabs(count[1][b] / all - 1.0 / BINS) < 0.015);
    }
    trainer_sample_plan_dispose(&p);
}

// A plan restored from its points and errors up to some round continues with the same points.
static void restored_plan_continues(void **state)
{
    (void)state;
    enum { START = 40, N = 1000, BREAK = START + 8 * SAMPLE_ROUND };
    sample_plan whole, rest;
    assert_int_equal(trainer_sample_plan_create(&whole, true, N, NULL), SDM_OK);
    trainer_sample_plan_start(&whole, START);
    plan_run(&whole, START, START);
    assert_int_equal(trainer_sample_plan_create(&rest, true, N, NULL), SDM_OK);
    rest.n_planned = BREAK + 2 * SAMPLE_ROUND;
    memcpy(rest.point, whole.point, rest.n_planned * sizeof *rest.point);
    memcpy(rest.error, whole.error, BREAK * sizeof *rest.error);
    plan_run(&rest, START, BREAK);
    assert_memory_equal(whole.point, rest.point, N * sizeof *whole.point);
    assert_memory_equal(whole.error, rest.error, N * sizeof *whole.error);
    assert_int_not_equal(whole.point[N - 1], N - 1);
    trainer_sample_plan_dispose(&whole);
    trainer_sample_plan_dispose(&rest);
}

// Without usable observations (errors of 0 or NaN) all points are taken in order.
static void without_errors_all_points_are_taken(void **state)
{
    (void)state;
    enum { START = 10, N = 300 };
    sample_plan p;
    assert_int_equal(trainer_sample_plan_create(&p, true, N, NULL), SDM_OK);
    trainer_sample_plan_start(&p, START);
    trainer_sample_plan_observe(&p, START, 3, (const double[]){0, 0, NAN});
    for (size_t taken = START; taken <= N; taken++)
        assert_int_equal(trainer_sample_plan_extend(&p, &space, START, taken, NULL), SDM_OK);
    for (size_t i = 0; i < N; i++) assert_int_equal(trainer_sample_plan_point(&p, i), i);
    trainer_sample_plan_dispose(&p);
    assert_int_equal(trainer_sample_plan_create(&p, false, N, NULL), SDM_OK);
    trainer_sample_plan_start(&p, START);
    assert_true(p.n_planned == N && trainer_sample_plan_point(&p, N - 1) == N - 1);
    trainer_sample_plan_dispose(&p);
}

static const char base[] =
    "shape: {name: capsule}\n"
    "grid: {size: [12, 10, 10], spacing: 1.2}\n"
    "network: {kind: pod, depth: 2, width: 16, rank: 4, modes: 16, degree: 2, input_degree: 2}\n"
    "data: {static: 0, start: 60, online: 200, holdout: 8, memory_gb: 0.5, sampling: error}\n"
    "train: {steps: 150, batch: 8, refine: 0.3, refine_batch: 8, average: 0.99}\n";

static sdm_status train(const char *override, int threads, bool resume,
                        const sdm_train_hooks *hooks)
{
    sdm_config c;
    sdm_error e = {0};
    if (sdm_config_parse("test.yaml", base, sizeof base - 1, &override, override ? 1 : 0, &c, &e))
        fail_msg("%s", e.text);
    c.threads = c.data.workers = threads;
    const sdm_status s = sdm_train(&c, capsule, folder, resume, hooks, NULL, &e);
    if (s && s != SDM_E_CANCELLED && s != SDM_E_CONFIG) fail_msg("%s", e.text);
    return s;
}

static sdm_model *trained_model(void)
{
    sdm_model *m;
    sdm_error e = {0};
    if (sdm_model_open(in_folder("model.sdm"), &m, &e)) fail_msg("%s", e.text);
    return m;
}

// One map of the model, as a fingerprint of its weights.
static void model_map(float *map)
{
    const double p[2] = {3, 1.5};
    sdm_model *m = trained_model();
    void *scratch;
    assert_int_equal(sdm_model_get_info(m)->n_params, 2);
    assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
    sdm_model_forward(m, p, 1, map, scratch);
    sdm_free(scratch);
    sdm_model_free(m);
}

enum { VOXELS = 12 * 10 * 10 };

static void same_bits_for_threads(void **state)
{
    (void)state;
    float first[VOXELS], other[VOXELS];
    for (int threads = 1; threads <= 4; threads++) {
        run_files_remove();
        assert_int_equal(train(NULL, threads, false, NULL), SDM_OK);
        model_map(threads == 1 ? first : other);
        if (threads > 1) assert_memory_equal(first, other, sizeof first);
    }
    // Error-driven sampling does change the result.
    run_files_remove();
    assert_int_equal(train("data.sampling=uniform", 2, false, NULL), SDM_OK);
    model_map(other);
    assert_memory_not_equal(first, other, sizeof first);
}

static int64_t calls, stop_after;

static bool stop(void *user)
{
    (void)user;
    return ++calls > stop_after;
}

static void resume_is_bit_exact(void **state)
{
    (void)state;
    float whole[VOXELS], resumed[VOXELS];
    run_files_remove();
    assert_int_equal(train(NULL, 2, false, NULL), SDM_OK);
    model_map(whole);
    // The hook is called once for each of the 68 maps before training, then about once a step: two
    // stops lie in the fit of the network, one in the refinement.
    const int64_t stops[] = {110, 150, 200};
    for (size_t i = 0; i < sizeof stops / sizeof *stops; i++) {
        run_files_remove();
        calls = 0, stop_after = stops[i];
        const sdm_train_hooks hooks = {.cancelled = stop};
        assert_int_equal(train(NULL, 3, false, &hooks), SDM_E_CANCELLED);
        assert_int_equal(train("data.sampling=uniform", 1, true, NULL), SDM_E_CONFIG);
        assert_int_equal(train(NULL, 1, true, NULL), SDM_OK);
        model_map(resumed);
        assert_memory_equal(whole, resumed, sizeof whole);
    }
}

// Without hidden layers there is no network to measure errors with: all points are used, and
// training must not wait for errors.
static void polynomials_need_no_errors(void **state)
{
    (void)state;
    run_files_remove();
    assert_int_equal(train("network.depth=0", 2, false, NULL), SDM_OK);
}

static void small_memory_and_short_time_work(void **state)
{
    (void)state;
    run_files_remove();
    assert_int_equal(train("data.memory_gb=0.001", 2, false, NULL), SDM_OK);
    run_files_remove();
    assert_int_equal(train("train.minutes=0.02", 2, false, NULL), SDM_OK);
}

static void other_kinds_are_refused(void **state)
{
    (void)state;
    static const char text[] =
        "shape: {name: capsule}\ngrid: {size: [8, 8, 8], spacing: 1}\n"
        "network: {kind: sdmnn}\ndata: {sampling: error}\ntrain: {steps: 1}\n";
    sdm_config c;
    sdm_error e = {0};
    assert_int_equal(sdm_config_parse("x.yaml", text, sizeof text - 1, NULL, 0, &c, &e),
                     SDM_E_CONFIG);
    assert_non_null(strstr(e.text, "data.sampling"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(regression_finds_a_polynomial),
        cmocka_unit_test(density_follows_the_error),
        cmocka_unit_test(restored_plan_continues),
        cmocka_unit_test(without_errors_all_points_are_taken),
        cmocka_unit_test(same_bits_for_threads),
        cmocka_unit_test(resume_is_bit_exact),
        cmocka_unit_test(polynomials_need_no_errors),
        cmocka_unit_test(small_memory_and_short_time_work),
        cmocka_unit_test(other_kinds_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
