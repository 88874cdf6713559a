/* Training of the kinds of network that learn by gradient descent on maps: accuracy, losses, the
 * same bits for any number of threads, resume.
 * Tests: direct.c point_kind.c sdmnn_kind.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "train_tools.h"

static const char base[] = "shape: {name: capsule}\n"
                           "grid: {size: [16, 14, 12], spacing: 1}\n"
                           "data: {static: 2, start: 60, online: 40, holdout: 8, memory_gb: 0.5}\n"
                           "train: {steps: 400, average: 0.98, learning_rate: 0.01}\n";

// Each kind of network, small enough for a test.
static const struct kind {
    const char *name;
    double rmse_mm; // error that training must reach; the mean map alone has more than 1 mm
    const char *overrides[6];
} kinds[] = {
    {"deepsdf",
     0.4,
     {"network.kind=deepsdf", "network.depth=4", "network.width=32", "train.batch=4",
      "train.points=128"}},
    {"imnet",
     0.4,
     {"network.kind=imnet", "network.depth=3", "network.width=48", "train.batch=4",
      "train.points=128"}},
    {"sdmnn",
     0.2, // 0.46 with random weights only
     {"network.kind=sdmnn", "network.depth=3", "network.channels=4", "network.dropout=0.05",
      "train.batch=4"}},
};
enum { KINDS = sizeof kinds / sizeof *kinds };

static void read_config(sdm_config *c, const struct kind *kind, const char *const *more,
                        size_t n_more)
{
    sdm_error e = {0};
    const char *overrides[16];
    size_t n = 0;
    while (n < 6 && kind->overrides[n]) overrides[n] = kind->overrides[n], n++;
    for (size_t i = 0; i < n_more; i++) overrides[n++] = more[i];
    if (sdm_config_parse("test.yaml", base, sizeof base - 1, overrides, n, c, &e))
        fail_msg("%s", e.text);
}

static sdm_train_report train(const sdm_config *c)
{
    sdm_error e = {0};
    sdm_train_report r;
    run_files_remove();
    if (sdm_train(c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    return r;
}

static void training_reaches_its_accuracy(void **state)
{
    (void)state;
    for (size_t k = 0; k < KINDS; k++) {
        sdm_config c;
        read_config(&c, &kinds[k], NULL, 0);
        const sdm_train_report r = train(&c);
        if (!(r.accuracy.rmse_mm < kinds[k].rmse_mm))
            fail_msg("%s: %g mm", kinds[k].name, r.accuracy.rmse_mm);
        assert_int_equal(r.steps, 400);
        assert_int_equal(r.samples, 4 + 60 + 40);
        assert_true(exists("config.yaml") && exists("metrics.jsonl") && exists("loss.png"));
        sdm_model *m;
        sdm_error e = {0};
        if (sdm_model_open(r.model_path, &m, &e)) fail_msg("%s", e.text);
        const sdm_model_info *info = sdm_model_get_info(m);
        assert_string_equal(info->kind, kinds[k].name);
        assert_true(info->accuracy.rmse_mm == r.accuracy.rmse_mm);
        // The configuration stored in the model can be read again.
        sdm_config again;
        if (sdm_config_parse("stored", info->config, strlen(info->config), NULL, 0, &again, &e))
            fail_msg("%s", e.text);
        assert_true(again.network.kind == c.network.kind && again.network.depth == c.network.depth);
        sdm_model_free(m);
    }
}

// Every loss changes the network and still trains it.
static void every_loss_trains(void **state)
{
    (void)state;
    for (size_t k = 0; k < KINDS; k++) {
        sdm_config c;
        read_config(
            &c, &kinds[k],
            (const char *const[]){"train.steps=150", "train.near_weight=20", "train.near_mm=1"}, 3);
        const double near = train(&c).accuracy.rmse_mm;
        read_config(&c, &kinds[k], (const char *const[]){"train.steps=150"}, 1);
        const uint64_t plain = (train(&c), hash_of("model.sdm"));
        static const char *const other[] = {"train.loss=l1", "train.loss=huber",
                                            "train.eikonal=0.05"};
        for (size_t i = 0; i < 3; i++) {
            read_config(&c, &kinds[k], (const char *const[]){"train.steps=150", other[i]}, 2);
            const double rmse = train(&c).accuracy.rmse_mm;
            if (!(rmse < 2.25 * kinds[k].rmse_mm))
                fail_msg("%s, %s: %g mm", kinds[k].name, other[i], rmse);
            assert_true(hash_of("model.sdm") != plain);
        }
        // With a clamp, distances within it are learned, those beyond are not.
        read_config(&c, &kinds[k],
                    (const char *const[]){"train.loss=clamped_l1", "train.clamp_mm=1"}, 2);
        const sdm_accuracy clamped = train(&c).accuracy;
        if (!(clamped.rmse_near_mm < kinds[k].rmse_mm && clamped.rmse_mm > clamped.rmse_near_mm &&
              near < 2.25 * kinds[k].rmse_mm))
            fail_msg("%s: %g mm near, %g mm", kinds[k].name, clamped.rmse_near_mm, clamped.rmse_mm);
    }
}

static void same_bits_for_threads(void **state)
{
    (void)state;
    for (size_t k = 0; k < KINDS; k++) {
        uint64_t model[3], metrics[3];
        for (int threads = 1; threads <= 3; threads++) {
            sdm_config c;
            read_config(&c, &kinds[k],
                        (const char *const[]){"train.steps=60", "train.eikonal=0.01"}, 2);
            c.threads = c.data.workers = threads;
            train(&c);
            model[threads - 1] = hash_of("model.sdm");
            metrics[threads - 1] = hash_of("metrics.jsonl");
        }
        assert_true(model[0] == model[1] && model[1] == model[2]);
        assert_true(metrics[0] == metrics[1] && metrics[1] == metrics[2]);
    }
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
    for (size_t k = 0; k < KINDS; k++) {
        sdm_config c;
        sdm_error e = {0};
        read_config(&c, &kinds[k], (const char *const[]){"train.steps=60"}, 1);
        train(&c);
        const uint64_t whole = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl");
        // Stopped while data are made, and at the beginning and in the middle of the training.
        const int64_t stops[] = {20, 80, 110};
        for (size_t i = 0; i < 3; i++) {
            run_files_remove();
            calls = 0, stop_after = stops[i];
            const sdm_train_hooks hooks = {.cancelled = stop};
            assert_int_equal(sdm_train(&c, capsule, folder, false, &hooks, NULL, &e),
                             SDM_E_CANCELLED);
            assert_false(exists("model.sdm"));
            assert_true(exists("checkpoint.sdmc") == (i > 0));
            // A checkpoint of another network is refused.
            sdm_config other;
            read_config(&other, &kinds[k],
                        (const char *const[]){"train.steps=60", "network.depth=2"}, 2);
            if (i > 0)
                assert_int_equal(sdm_train(&other, capsule, folder, true, NULL, NULL, &e),
                                 SDM_E_CONFIG);
            if (sdm_train(&c, capsule, folder, true, NULL, NULL, &e)) fail_msg("%s", e.text);
            assert_true(hash_of("model.sdm") == whole);
            assert_true(hash_of("metrics.jsonl") == metrics);
        }
    }
}

static void time_budget_works(void **state)
{
    (void)state;
    for (size_t k = 0; k < KINDS; k++) {
        sdm_config c;
        read_config(&c, &kinds[k],
                    (const char *const[]){"train.minutes=0.02", "train.evaluate_seconds=0.1"}, 2);
        const sdm_train_report r = train(&c);
        sdm_model *m;
        assert_int_equal(sdm_model_open(r.model_path, &m, NULL), SDM_OK);
        assert_true(sdm_model_get_info(m)->train_seconds > 0 && isfinite(r.accuracy.rmse_mm));
        sdm_model_free(m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(training_reaches_its_accuracy), cmocka_unit_test(every_loss_trains),
        cmocka_unit_test(same_bits_for_threads), cmocka_unit_test(resume_is_bit_exact),
        cmocka_unit_test(time_budget_works)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
