/* The folder of a run: its lock, what killed runs leave, files that cannot be written for a while,
 * forged checkpoints.
 * Tests: checkpoint.c child.c data_files.c file.c history.c progress.c refine.c train_folder.c
 * train.c */
#include <errno.h>
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/internal/container.h"
#include "state/turns.h"
#include "train_folder.h"
#include "train_tools.h"

static const char base[] =
    "shape: {name: capsule}\n"
    "grid: {size: [12, 10, 8], spacing: 1.4}\n"
    "network: {kind: pod, depth: 1, width: 8, rank: 4, levels: 1, block: 4, modes: 8, degree: 2,\n"
    "  input_degree: 2}\n"
    "data: {static: 2, start: 24, online: 16, holdout: 4}\n"
    "train: {steps: 400, batch: 4, refine_batch: 4, checkpoint_seconds: 0.001}\n";

static void read_config(sdm_config *c, const char *override)
{
    *c = parse_config(base, &override, override != NULL);
}

static void touch(const char *name)
{
    FILE *f = fopen(in_folder(name), "w");
    assert_non_null(f);
    fclose(f);
}

static void one_run_has_the_folder(void **state)
{
    (void)state;
    sdm_error e = {0};
    sdm_config c;
    int lock, other;
    assert_int_equal(trainer_folder_take(folder, &lock, &e), SDM_OK);
    assert_int_equal(trainer_folder_take(folder, &other, &e), SDM_E_ARG);
    char mine[64];
    snprintf(mine, sizeof mine, "(process %ld on ", (long)getpid());
    assert_non_null(strstr(e.text, mine));
    read_config(&c, NULL);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_ARG);
    assert_non_null(strstr(e.text, "another training writes into this folder"));
    trainer_folder_leave(folder, lock);
    assert_false(exists("run.lock"));
}

/* A run that is killed leaves its lock as a file, which holds nobody up, and temporary files. */
static void killed_run_gives_way(void **state)
{
    (void)state;
    static const char *const gone[] = {"model.sdm.123.0.tmp", "checkpoint.sdmc.99.12.tmp",
                                       "slices.png.1.1.tmp", "shape.mean.ply.5.0.tmp"};
    static const char *const kept[] = {
        "model.sdm.123.tmp", "map.vdb.1.1.tmp",    "model.sdm.1.x.tmp", "model.sdm.1.1.tmp2",
        "model.sdm1.1.tmp",  "shape.mean.ply.tmp", "shapes.1.1.tmp"};
    sdm_error e = {0};
    int lock, ready[2];
    assert_int_equal(pipe(ready), 0);
    const pid_t child = fork();
    if (child == 0) {
        const char got = trainer_folder_take(folder, &lock, NULL) == SDM_OK;
        if (write(ready[1], &got, 1) == 1) pause();
        _exit(1);
    }
    char got = 0;
    assert_int_equal(read(ready[0], &got, 1), 1);
    assert_int_equal(got, 1);
    assert_int_equal(trainer_folder_take(folder, &lock, &e), SDM_E_ARG);
    char holder[64];
    snprintf(holder, sizeof holder, "(process %ld on ", (long)child);
    assert_non_null(strstr(e.text, holder));
    kill(child, SIGKILL);
    assert_int_equal(waitpid(child, NULL, 0), child);
    assert_true(exists("run.lock"));
    for (size_t i = 0; i < sizeof gone / sizeof *gone; i++) touch(gone[i]);
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++) touch(kept[i]);
    assert_int_equal(trainer_folder_take(folder, &lock, &e), SDM_OK);
    trainer_folder_leave(folder, lock);
    for (size_t i = 0; i < sizeof gone / sizeof *gone; i++) assert_false(exists(gone[i]));
    for (size_t i = 0; i < sizeof kept / sizeof *kept; i++)
        assert_int_equal(remove(in_folder(kept[i])), 0);
    close(ready[0]);
    close(ready[1]);
}

/* A run is killed while it has a child, which holds the lock for a while: the next run waits. */
static void child_of_killed_run_gives_way(void **state)
{
    (void)state;
    int lock, ready[2];
    assert_int_equal(pipe(ready), 0);
    const pid_t run = fork();
    if (run == 0) {
        const char got = trainer_folder_take(folder, &lock, NULL) == SDM_OK;
        const pid_t child = fork();
        if (child == 0) {
            nanosleep(&(struct timespec){0, 300000000}, NULL);
            _exit(0);
        }
        if (write(ready[1], &got, 1) == 1) pause();
        _exit(1);
    }
    char got = 0;
    assert_int_equal(read(ready[0], &got, 1), 1);
    assert_int_equal(got, 1);
    kill(run, SIGKILL);
    assert_int_equal(waitpid(run, NULL, 0), run);
    sdm_error e = {0};
    assert_int_equal(trainer_folder_take(folder, &lock, &e), SDM_OK);
    trainer_folder_leave(folder, lock);
    close(ready[0]);
    close(ready[1]);
}

/* A planted link is not followed: its target would be emptied. */
static void planted_lock_is_refused(void **state)
{
    (void)state;
    sdm_error e = {0};
    int lock;
    assert_int_equal(symlink("target", in_folder("run.lock")), 0);
    assert_int_equal(trainer_folder_take(folder, &lock, &e), SDM_E_IO);
    assert_non_null(strstr(e.text, "run.lock"));
    assert_false(exists("target"));
    assert_int_equal(remove(in_folder("run.lock")), 0);
}

static int calls, warnings, blocked;
static const char *block;

/* Puts a folder in the place of the file `block` while the training runs, and takes it away later.
 */
static void block_or_free(void)
{
    enum { FROM = 150, TO = 300 };
    if (++calls < FROM || !block) return;
    if (calls < TO && !blocked) {
        unlink(in_folder(block));
        blocked = !mkdir(in_folder(block), 0700);
    } else if (calls >= TO && blocked) {
        assert_int_equal(rmdir(in_folder(block)), 0);
        blocked = 0, block = NULL;
    }
}

/* The hooks are called by any thread of the training; one at a time works. */
static pthread_mutex_t hook = PTHREAD_MUTEX_INITIALIZER;

static bool block_for_a_while(void *user)
{
    (void)user;
    pthread_mutex_lock(&hook);
    block_or_free();
    pthread_mutex_unlock(&hook);
    return false;
}

static void count_warnings(void *user, const char *line)
{
    assert_non_null(strstr(line, user));
    warnings++;
}

static void files_that_cannot_be_written_do_not_end_a_training(void **state)
{
    (void)state;
    static char names[][20] = {"checkpoint.sdmc", "metrics.jsonl"}, none[] = "";
    sdm_config c;
    sdm_error e = {0};
    uint64_t model = 0, metrics = 0;
    read_config(&c, "data.workers=1");
    for (int i = -1; i < 2; i++) {
        run_files_remove();
        calls = warnings = 0, block = i < 0 ? NULL : names[i];
        const sdm_train_hooks hooks = {.cancelled = block_for_a_while,
                                       .warning = count_warnings,
                                       .user = i < 0 ? none : names[i]};
        if (sdm_train(&c, capsule, folder, false, &hooks, NULL, &e)) fail_msg("%s", e.text);
        assert_null(block);
        assert_true((warnings > 0) == (i >= 0));
        if (i < 0) model = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl");
        assert_true(hash_of("model.sdm") == model && hash_of("metrics.jsonl") == metrics);
    }
}

static bool stop_in_training(void *user)
{
    (void)user;
    pthread_mutex_lock(&hook);
    const bool stop = exists("metrics.jsonl") && ++calls > 60;
    pthread_mutex_unlock(&hook);
    return stop;
}

/* The checkpoint as it is on disk; rewritten with one section changed. */
typedef struct checkpoint {
    uint8_t *bytes;
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n;
} checkpoint;

static void read_checkpoint(checkpoint *o)
{
    size_t size;
    uint64_t sum;
    sdm_error e = {0};
    assert_int_equal(sdm_file_read(in_folder("checkpoint.sdmc"), 1 << 30, &o->bytes, &size, &e), 0);
    if (sdm_container_parse(o->bytes, size, o->sections, o->names, &o->n, &sum, &e))
        fail_msg("%s", e.text);
}

static void write_with(const checkpoint *o, const char *name, const void *data, size_t size)
{
    sdm_section all[SDM_CONTAINER_MAX_SECTIONS];
    uint8_t *bytes;
    size_t total, changed = 0;
    memcpy(all, o->sections, o->n * sizeof *all);
    for (size_t i = 0; i < o->n; i++)
        if (!strcmp(all[i].name, name)) all[i].data = data, all[i].size = size, changed++;
    assert_int_equal(changed, 1);
    assert_int_equal(sdm_container_build(all, o->n, &bytes, &total, NULL), SDM_OK);
    assert_int_equal(sdm_container_write(in_folder("checkpoint.sdmc"), bytes, total, NULL), 0);
    sdm_free(bytes);
}

/* Stops a training after `after` and reads its checkpoint. */
static void make_checkpoint(sdm_config *c, checkpoint *o)
{
    sdm_error e = {0};
    const sdm_train_hooks hooks = {.cancelled = stop_in_training};
    run_files_remove();
    calls = 0;
    assert_int_equal(sdm_train(c, capsule, folder, false, &hooks, NULL, &e), SDM_E_CANCELLED);
    read_checkpoint(o);
}

/* The counters are five doubles and six integers: phase, step, phase_step, n_start, n_taken, bases;
 * the doubles are seconds, phase_started, last_evaluation, loss, heldout_mse. */
static void forged_counters_are_refused(void **state)
{
    (void)state;
    enum { PHASE = 5, STEP, PHASE_STEP, N_START, N_TAKEN };
    static const struct {
        int at;
        int64_t value;
    } forged[] = {{PHASE_STEP, 0},          {PHASE_STEP, -1}, {PHASE, 77},    {STEP, INT64_MAX},
                  {N_START, INT64_MAX},     {N_TAKEN, -1},    {PHASE, 1},     {STEP, -1},
                  {0, INT64_MAX /* NaN */}, {1, INT64_MAX},   {2, INT64_MAX}, {N_START, -5}};
    sdm_config c;
    sdm_error e = {0};
    checkpoint o = {0};
    read_config(&c, NULL);
    make_checkpoint(&c, &o);
    for (size_t i = 0; i < sizeof forged / sizeof *forged; i++) {
        int64_t counters[11];
        size_t k = 0;
        while (strcmp(o.names[k], "checkpoint") != 0) k++;
        assert_int_equal(o.sections[k].size, sizeof counters);
        memcpy(counters, o.sections[k].data, sizeof counters);
        assert_true(counters[PHASE] == 2 && counters[PHASE_STEP] > 0);
        counters[forged[i].at] = forged[i].value;
        write_with(&o, "checkpoint", counters, sizeof counters);
        const sdm_status s = sdm_train(&c, capsule, folder, true, NULL, NULL, &e);
        if (s != SDM_E_FORMAT && s != SDM_E_CONFIG)
            fail_msg("forged counter %zu: status %d", i, (int)s);
    }
    sdm_free(o.bytes);
}

/* Metrics that are no whole lines of text. */
static void forged_metrics_are_refused(void **state)
{
    (void)state;
    static const char line[] = "{\"phase\": \"fit\", \"step\": 3}\n";
    static char many[100 * sizeof line];
    sdm_config c;
    sdm_error e = {0};
    checkpoint o = {0};
    read_config(&c, NULL);
    make_checkpoint(&c, &o);
    size_t n = 0;
    for (int i = 0; i < 100; i++) n += (size_t)snprintf(many + n, sizeof many - n, "%s", line);
    const struct {
        const char *text;
        size_t size;
    } forged[] = {{many, n - 1}, {line, sizeof line}, {line, sizeof line - 2}};
    for (size_t i = 0; i < sizeof forged / sizeof *forged; i++) {
        write_with(&o, "metrics", forged[i].text, forged[i].size);
        assert_int_equal(sdm_train(&c, capsule, folder, true, NULL, NULL, &e), SDM_E_FORMAT);
        assert_non_null(strstr(e.text, "its metrics are damaged"));
    }
    sdm_free(o.bytes);
}

/* A result of the first training that claims other lengths, numbers or texts. */
static void forged_turns_are_refused(void **state)
{
    (void)state;
    static const size_t bytes_at[] = {offsetof(training_turns, chosen),
                                      offsetof(training_turns, first.compared),
                                      offsetof(training_turns, first.verdict.limited),
                                      offsetof(training_turns, first.verdict.grade),
                                      offsetof(training_turns, first.verdict.limit)};
    sdm_config c, automatic;
    sdm_error e = {0};
    checkpoint o = {0};
    read_config(&c, NULL);
    read_config(&automatic, "network={kind: auto, width: 8}");
    make_checkpoint(&c, &o);
    training_turns sound = {.n = 2,
                            .at = 1,
                            .kind = {SDM_NETWORK_TEMPLATE, SDM_NETWORK_POD},
                            .chosen = true,
                            .share = 0.5};
    for (size_t i = 0; i < 8; i++) {
        training_turns t = sound;
        if (i < 5) ((uint8_t *)&t)[bytes_at[i]] = 200;
        if (i == 5) memset(t.first.verdict.sentence, 'x', sizeof t.first.verdict.sentence);
        if (i == 6) memset(t.first.verdict.key, 'x', sizeof t.first.verdict.key);
        write_with(&o, "turns", &t, sizeof t);
        const sdm_status s = sdm_train(&automatic, capsule, folder, true, NULL, NULL, &e);
        const bool refused = s == SDM_E_FORMAT && strstr(e.text, "its list of kinds is damaged");
        if (refused != (i < 7)) fail_msg("forged turns %zu: %s", i, e.text); // 7: not forged
    }
    sdm_free(o.bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_run_has_the_folder),
        cmocka_unit_test(killed_run_gives_way),
        cmocka_unit_test(child_of_killed_run_gives_way),
        cmocka_unit_test(planted_lock_is_refused),
        cmocka_unit_test(files_that_cannot_be_written_do_not_end_a_training),
        cmocka_unit_test(forged_counters_are_refused),
        cmocka_unit_test(forged_metrics_are_refused),
        cmocka_unit_test(forged_turns_are_refused)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
