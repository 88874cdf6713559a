/* Training of the template network: accuracy without a training step, accuracy with a correction,
 * the same bits for any number of threads and after a resume, the choice of
 * the kind.
 * Tests: design.c race.c rotations.c set_up.c template_kind.c template_maps.c warp_modes.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "template_shapes.h"
#include "train_tools.h"

static const char mechanism_text[] =
    "shape: {name: mechanism}\n"
    "grid: {size: [48, 44, 40], spacing: 0.4, centre: [1.5, 0, 0]}\n"
    "network: {kind: template}\n"
    "data: {start: 100, online: 0, holdout: 12, memory_gb: 0.5}\n"
    "train: {steps: 100}\n";

static const char ring_text[] =
    "shape: {name: ring}\n"
    "grid: {size: [26, 26, 16], spacing: 0.4}\n"
    "network: {kind: template, degree: 2}\n"
    "data: {static: 0, static_share: 0, start: 150, online: 50, holdout: 16, memory_gb: 0.5}\n"
    "train: {steps: 300}\n";

static const char welded_text[] = "shape: {name: welded}\n"
                                  "grid: {size: [32, 40, 40], spacing: 0.4, centre: [4.5, 0, 0]}\n"
                                  "network: {kind: template}\n"
                                  "data: {start: 100, online: 0, holdout: 12, memory_gb: 0.5}\n"
                                  "train: {steps: 1}\n";

static void read_config(sdm_config *c, const char *text, const char *const *overrides, size_t n)
{
    sdm_error e = {0};
    if (sdm_config_parse("test.yaml", text, strlen(text), overrides, n, c, &e))
        fail_msg("%s", e.text);
}

static sdm_train_report train(const sdm_config *c, const sdm_instance *shape)
{
    sdm_error e = {0};
    sdm_train_report r;
    run_files_remove();
    if (sdm_train(c, shape, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    return r;
}

// The parts of a mechanism are exact: no training step is needed, and none is done.
static void mechanism_needs_no_training(void **state)
{
    (void)state;
    mistaken = NONE;
    sdm_instance *shape = instance_of(&mechanism);
    sdm_config c;
    read_config(&c, mechanism_text, NULL, 0);
    const sdm_train_report r = train(&c, shape);
    assert_int_equal(r.steps, 0);
    if (!(r.accuracy.rmse_near_mm < 0.4 / 20)) fail_msg("%g mm", r.accuracy.rmse_near_mm);
    sdm_model *m;
    assert_int_equal(sdm_model_open(r.model_path, &m, NULL), SDM_OK);
    assert_string_equal(sdm_model_get_info(m)->kind, "template");
    sdm_model_free(m);
    sdm_instance_free(shape);
}

// Rotations of more than half a turn are as exact as small ones.
static void turns_are_unwrapped(void **state)
{
    (void)state;
    mistaken = NONE;
    sdm_instance *shape = instance_of(&wide_mechanism);
    sdm_config c;
    read_config(&c, mechanism_text, NULL, 0);
    const sdm_train_report r = train(&c, shape);
    if (!(r.accuracy.rmse_near_mm < 0.4 / 20)) fail_msg("%g mm", r.accuracy.rmse_near_mm);
    sdm_instance_free(shape);
}

// An arm of one surface: its links are found, and the joints follow by warps of their own. Returns
// the checksum of the model.
static uint64_t train_welded_arm(int threads)
{
    sdm_instance *shape = instance_of(&welded);
    sdm_config c;
    read_config(&c, welded_text, NULL, 0);
    c.threads = c.data.workers = threads;
    const sdm_train_report r = train(&c, shape);
    assert_int_equal(r.steps, 0);
    if (!(r.accuracy.rmse_near_mm < 0.4 / 10)) fail_msg("%g mm", r.accuracy.rmse_near_mm);
    sdm_instance_free(shape);
    return hash_of("model.sdm");
}

static void welded_arm_is_followed(void **state)
{
    (void)state;
    train_welded_arm(3);
}

// The same bits for one thread and for three.
static void welded_arm_by_threads_long(void **state)
{
    (void)state;
    const uint64_t one = train_welded_arm(1);
    assert_true(one == train_welded_arm(3));
}

// A ring that bends by more than its thickness.
static void ring_reaches_its_accuracy(void **state)
{
    (void)state;
    sdm_instance *shape = instance_of(&ring);
    sdm_config c;
    read_config(&c, ring_text, NULL, 0);
    const sdm_train_report r = train(&c, shape);
    assert_int_equal(r.steps, 300);
    if (!(r.accuracy.rmse_near_mm < 0.4 / 15)) fail_msg("%g mm", r.accuracy.rmse_near_mm);
    sdm_instance_free(shape);
}

static void same_bits_for_threads(void **state)
{
    (void)state;
    mistaken = NONE;
    for (int which = 0; which < 2; which++) {
        sdm_instance *shape = instance_of(which ? &ring : &mechanism);
        uint64_t model[2], metrics[2];
        for (int i = 0; i < 2; i++) {
            sdm_config c;
            read_config(&c, which ? ring_text : mechanism_text,
                        (const char *const[]){"train.steps=60", "data.start=60"}, 2);
            c.threads = c.data.workers = 1 + 2 * i;
            train(&c, shape);
            model[i] = hash_of("model.sdm");
            metrics[i] = hash_of("metrics.jsonl");
        }
        assert_true(model[0] == model[1]);
        assert_true(metrics[0] == metrics[1]);
        sdm_instance_free(shape);
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
    sdm_instance *shape = instance_of(&ring);
    sdm_config c, other;
    sdm_error e = {0};
    const char *const small[] = {"train.steps=80", "data.start=60", "data.online=20",
                                 "network.degree=1"};
    read_config(&c, ring_text, small, 3);
    read_config(&other, ring_text, small, 4);
    train(&c, shape);
    const uint64_t whole = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl");
    // Stopped while data are made, and at the beginning and near the end of the training.
    const int64_t stops[] = {60, 240, 285};
    for (size_t i = 0; i < 3; i++) {
        run_files_remove();
        calls = 0, stop_after = stops[i];
        const sdm_train_hooks hooks = {.cancelled = stop};
        assert_int_equal(sdm_train(&c, shape, folder, false, &hooks, NULL, &e), SDM_E_CANCELLED);
        assert_false(exists("model.sdm"));
        assert_true(exists("checkpoint.sdmc") == (i > 0));
        if (i > 0)
            assert_int_equal(sdm_train(&other, shape, folder, true, NULL, NULL, &e), SDM_E_CONFIG);
        if (sdm_train(&c, shape, folder, true, NULL, NULL, &e)) fail_msg("%s", e.text);
        assert_true(hash_of("model.sdm") == whole);
        assert_true(hash_of("metrics.jsonl") == metrics);
    }
    sdm_instance_free(shape);
}

static char said[4096];

static void listen(void *user, const char *text)
{
    (void)user;
    strncat(said, text, sizeof said - strlen(said) - 2);
    strcat(said, "\n");
}

// network.kind: auto takes the template where it is exact, and pod where vertices do not
// correspond.
static void kind_is_chosen(void **state)
{
    (void)state;
    for (int which = 0; which < 2; which++) {
        mistaken = which ? COUNT : NONE;
        strange = mechanism_params[0].def;
        sdm_instance *shape = instance_of(&mechanism);
        uint64_t model[2];
        for (int threads = 1; threads <= 2; threads++) {
            sdm_config c;
            sdm_error e = {0};
            read_config(&c, mechanism_text,
                        (const char *const[]){"network.kind=auto", "train.steps=20",
                                              "data.start=40", "grid.size=[24, 22, 20]",
                                              "grid.spacing=0.8"},
                        which ? 5 : 3);
            c.threads = c.data.workers = threads;
            said[0] = '\0';
            run_files_remove();
            const sdm_train_hooks hooks = {.message = listen};
            sdm_train_report r;
            if (sdm_train(&c, shape, folder, false, &hooks, &r, &e)) fail_msg("%s", e.text);
            if (!strstr(said, which ? "network.kind is pod" : "network.kind is template"))
                fail_msg("%s", said);
            if (!which && !strstr(said, "template: 4 moving pieces of the 5 parts of the mesh ("))
                fail_msg("%s", said);
            if (which) assert_non_null(strstr(said, "vertices do not correspond"));
            model[threads - 1] = hash_of("model.sdm");
            sdm_model *m;
            assert_int_equal(sdm_model_open(r.model_path, &m, NULL), SDM_OK);
            assert_string_equal(sdm_model_get_info(m)->kind, which ? "pod" : "template");
            sdm_model_free(m);
        }
        assert_true(model[0] == model[1]);
        sdm_instance_free(shape);
    }
    mistaken = NONE;
}

// A shape whose vertices do not correspond is refused before any file is written.
static void other_meshes_are_refused(void **state)
{
    (void)state;
    run_files_remove();
    mistaken = COUNT;
    strange = mechanism_params[0].def;
    sdm_instance *shape = instance_of(&mechanism);
    sdm_config c;
    sdm_error e = {0};
    read_config(&c, mechanism_text, NULL, 0);
    assert_int_equal(sdm_train(&c, shape, folder, false, NULL, NULL, &e), SDM_E_UNSUPPORTED);
    assert_non_null(strstr(e.text, "vertices do not correspond"));
    assert_false(exists("model.sdm") || exists("config.yaml"));
    mistaken = NONE;
    sdm_instance_free(shape);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(mechanism_needs_no_training), cmocka_unit_test(turns_are_unwrapped),
        cmocka_unit_test(welded_arm_is_followed),      cmocka_unit_test(welded_arm_by_threads_long),
        cmocka_unit_test(ring_reaches_its_accuracy),   cmocka_unit_test(same_bits_for_threads),
        cmocka_unit_test(resume_is_bit_exact),         cmocka_unit_test(kind_is_chosen),
        cmocka_unit_test(other_meshes_are_refused)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
