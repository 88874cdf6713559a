/* The training of the library: the model of a configuration file, settings that replace keys,
 * mistakes, and a stop on request. Tests: train_file.c
 * train_folder.c train_shape.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/train_file.h"
#include "train_tools.h"

static char path[64];

static void write_config(const char *name)
{
    snprintf(path, sizeof path, "%s.yaml", folder);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "shape: {name: %s}\n"
            "grid: {size: [14, 12, 11], spacing: 1}\n"
            "network: {kind: pod, depth: 1, width: 16, rank: 4, modes: 16, degree: 2, "
            "input_degree: 2}\n"
            "data: {static: 0, start: 40, online: 0, holdout: 8}\n"
            "train: {steps: 40, batch: 16, refine: 0}\n",
            name);
    fclose(f);
}

typedef struct seen {
    size_t progress, messages;
    bool stop;
} seen;

static void count_progress(void *user, const sdm_training_progress *p)
{
    assert_in_range(p->maps, 0, 48);
    ((seen *)user)->progress++;
}

static void count_message(void *user, const char *line)
{
    assert_null(strchr(line, '\n'));
    ((seen *)user)->messages++;
}

static bool stopped(void *user) { return ((const seen *)user)->stop; }

static void trains_as_the_internal_function(void **state)
{
    (void)state;
    write_config("capsule");
    // the model of sdm_train()
    static sdm_config c;
    assert_int_equal(sdm_config_read(path, (const char *const[]){"seed=5"}, 1, &c, NULL), SDM_OK);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, NULL), SDM_OK);
    const uint64_t hash = hash_of("model.sdm");
    run_files_remove();
    // the same by the file
    seen s = {.stop = false};
    sdm_error e = {0};
    sdm_training_result r;
    const sdm_training_opts opts = {.settings = (const char *const[]){"seed=5"},
                                    .n_settings = 1,
                                    .folder = folder,
                                    .progress = count_progress,
                                    .cancelled = stopped,
                                    .message = count_message,
                                    .user = &s};
    if (sdm_training_run(path, registry, &opts, &r, &e)) fail_msg("%s", e.text);
    assert_true(hash == hash_of("model.sdm"));
    assert_true(s.progress > 0);
    assert_string_equal(r.model_path, in_folder("model.sdm"));
    assert_int_equal(r.steps, 40);
    assert_int_equal(r.maps, 40);
    assert_true(r.accuracy.samples == 8 && r.accuracy.rmse_mm > 0 && r.accuracy.rmse_mm < 1);
    assert_true(!strcmp(r.grade, "good") || !strcmp(r.grade, "usable") || !strcmp(r.grade, "poor"));
    // a folder with a model is in use, without a checkpoint there is nothing to continue
    sdm_training_opts again = opts;
    assert_int_equal(sdm_training_run(path, registry, &again, NULL, &e), SDM_E_ARG);
    assert_non_null(strstr(e.text, "holds a trained model"));
    again.resume = true;
    assert_int_equal(sdm_training_run(path, registry, &again, NULL, &e), SDM_E_ARG);
    assert_non_null(strstr(e.text, "no checkpoint"));
    assert_true(hash == hash_of("model.sdm"));
    again.resume = false, again.force = true;
    assert_int_equal(sdm_training_run(path, registry, &again, NULL, NULL), SDM_OK);
    remove(path);
}

static void refuses(const char *word, const char *setting, bool stop, sdm_status status,
                    const char *text)
{
    write_config(word);
    seen s = {.stop = stop};
    sdm_error e = {0};
    const sdm_training_opts opts = {.settings = &setting,
                                    .n_settings = setting ? 1 : 0,
                                    .folder = folder,
                                    .cancelled = stopped,
                                    .user = &s};
    run_files_remove();
    assert_int_equal(sdm_training_run(path, registry, &opts, NULL, &e), status);
    if (!strstr(e.text, text)) fail_msg("'%s' lacks '%s'", e.text, text);
    assert_false(exists("model.sdm"));
    remove(path);
}

static void mistakes_are_named(void **state)
{
    (void)state;
    refuses("capsul", NULL, false, SDM_E_CONFIG, "did you mean 'capsule'?");
    refuses("capsule", "network.dpth=3", false, SDM_E_CONFIG, "did you mean 'network.depth'?");
    refuses("capsule", "shape.ranges.radiuss=[1,2]", false, SDM_E_CONFIG, "radiuss");
    refuses("capsule", NULL, true, SDM_E_CANCELLED, "stopped on request");
    sdm_error e = {0};
    assert_int_equal(sdm_training_run(NULL, registry, NULL, NULL, &e), SDM_E_ARG);
    assert_int_equal(sdm_training_run("no-such.yaml", registry, NULL, NULL, &e), SDM_E_IO);
    assert_non_null(strstr(e.text, "no-such.yaml"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(trains_as_the_internal_function),
        cmocka_unit_test(mistakes_are_named),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
