/* The training of the fine level: it lowers the error between the voxels, has the same bits for any
 * number of threads, and is done again after an interruption.
 * Tests: fine_fit.c fine_samples.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/field.h"
#include "train_tools.h"

static const char text[] =
    "shape: {name: capsule}\n"
    "grid: {size: [20, 18, 16], spacing: 0.8}\n"
    "network: {kind: pod, depth: 1, width: 16, rank: 6, block: 8, modes: 16, degree: 3,\n"
    "  input_degree: 2, fine: 6}\n"
    "data: {static: 3, start: 60, online: 0, holdout: 10, memory_gb: 0.5}\n"
    "train: {steps: 200, batch: 32, refine: 0, average: 0.99}\n";

static void read_config(sdm_config *c, const char *override)
{
    *c = parse_config(text, &override, override != NULL);
}

static sdm_model *open_model(void)
{
    sdm_model *m;
    sdm_error e = {0};
    if (sdm_model_open(in_folder("model.sdm"), &m, &e)) fail_msg("%s", e.text);
    return m;
}

/* Mean square error halfway between the voxels, over shapes of another stream. */
static double error_between(const sdm_model *m)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    sdm_grid g = info->grid;
    enum { N = 38 * 34 * 30, SHAPES = 6 };
    static float values[N], exact[N];
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        g.n[a] = 2 * g.n[a] - 2;
        g.spacing[a] /= 2;
    }
    for (int i = 0; i < SHAPES; i++) {
        double p[8];
        sdm_mesh mesh = {0};
        sdm_exact *engine;
        for (size_t k = 0; k < info->n_params; k++)
            p[k] = info->params[k].min + (info->params[k].max - info->params[k].min) *
                                             fmod(0.137 + 0.618 * i + 0.29 * (double)k, 1);
        assert_false(sdm_instance_mesh(capsule, p, &mesh, NULL));
        assert_false(sdm_exact_create(&mesh, NULL, &engine, NULL));
        assert_false(sdm_exact_map(engine, &g, exact, NULL));
        assert_false(sdm_generate_grid(m, p, NULL, &g, values, NULL, NULL, NULL));
        for (int v = 0; v < N; v++)
            sum += ((double)values[v] - exact[v]) * ((double)values[v] - exact[v]);
        sdm_exact_free(engine);
        sdm_mesh_dispose(&mesh);
    }
    return sum / SHAPES / N;
}

static char message[300];
static bool evaluates;

static void take_message(void *user, const char *line)
{
    (void)user;
    if (strstr(line, "fine level")) snprintf(message, sizeof message, "%s", line);
}

static void watch(void *user, const sdm_progress *p)
{
    (void)user;
    evaluates = p->phase == SDM_PHASE_EVALUATE;
}

static bool stop(void *user)
{
    (void)user;
    return evaluates;
}

static void training_adds_a_fine_level(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_hooks hooks = {.message = take_message};
    // without
    read_config(&c, "network.fine=0");
    c.threads = 1;
    if (sdm_train(&c, capsule, folder, false, &hooks, NULL, &e)) fail_msg("%s", e.text);
    sdm_model *m = open_model();
    const double before = error_between(m);
    assert_true(sdm_model_get_info(m)->fine_width == 0 && !*message);
    sdm_model_free(m);
    // with
    run_files_remove();
    read_config(&c, NULL);
    c.threads = 1;
    if (sdm_train(&c, capsule, folder, false, &hooks, NULL, &e)) fail_msg("%s", e.text);
    m = open_model();
    assert_int_equal(sdm_model_get_info(m)->fine_width, 8);
    assert_true(error_between(m) < 0.9 * before);
    sdm_model_free(m);
    double all[2], near_mm, near[2];
    assert_int_equal(sscanf(message,
                            "fine level: RMSE between the voxels %lf -> %lf mm, within %lf mm of "
                            "the surface %lf -> %lf mm",
                            &all[0], &all[1], &near_mm, &near[0], &near[1]),
                     5);
    assert_true(all[1] < all[0] && near[1] < near[0] && near_mm == 1.6);
    assert_true(fabs(all[0] / sqrt(before) - 1) < 0.3);
    const uint64_t whole = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl");

    // stopped while the fine level is trained, then resumed with other threads
    run_files_remove();
    hooks = (sdm_train_hooks){.progress = watch, .cancelled = stop};
    c.threads = 3;
    assert_int_equal(sdm_train(&c, capsule, folder, false, &hooks, NULL, &e), SDM_E_CANCELLED);
    assert_true(exists("checkpoint.sdmc"));
    if (sdm_train(&c, capsule, folder, true, NULL, NULL, &e)) fail_msg("%s", e.text);
    assert_true(hash_of("model.sdm") == whole && hash_of("metrics.jsonl") == metrics);
    assert_false(exists("checkpoint.sdmc"));
}

static void a_budget_of_time_holds(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    run_files_remove();
    read_config(&c, "train={minutes: 0.1, batch: 32, refine: 0, average: 0.99}");
    c.network.fine = 256; // all steps would take minutes
    const sdm_train_hooks hooks = {.message = take_message};
    if (sdm_train(&c, capsule, folder, false, &hooks, &r, &e)) fail_msg("%s", e.text);
    sdm_model *m = open_model();
    // a level that gains nothing in this time is left out
    assert_int_equal(sdm_model_get_info(m)->fine_width, strstr(message, "left out") ? 0 : 256);
    sdm_model_free(m);
    assert_true(r.seconds < 40);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(training_adds_a_fine_level),
                                       cmocka_unit_test(a_budget_of_time_holds)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
