/* Training end to end on small grids: accuracy, the same bits for any number of threads, resume,
 * cancellation, mistakes.
 * Tests: bases.c blocks.c checkpoint.c coefficients.c dataset.c dataset_fill.c export_model.c
 * head.c mode_fit.c modes.c new_samples.c pod_kind.c pod_tree.c producer.c progress.c refine.c
 * ranges.c sample_plan.c train.c workbench.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <cmocka.h>

#include "data/dataset_fill.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/sampling.h"
#include "train_tools.h"

static const char base[] =
    "shape: {name: capsule}\n"
    "grid: {size: [20, 18, 16], spacing: 0.8}\n"
    "network: {kind: pod, depth: 2, width: 24, rank: 6, block: 8, modes: 32, degree: 3,\n"
    "  input_degree: 3}\n"
    "data: {static: 3, start: 150, online: 100, holdout: 20, memory_gb: 0.5}\n"
    "train: {steps: 1200, batch: 32, refine: 0.5, refine_batch: 8, average: 0.99}\n";

static void read_config(sdm_config *c, const char *const *overrides, size_t n)
{
    sdm_error e = {0};
    if (sdm_config_parse("test.yaml", base, sizeof base - 1, overrides, n, c, &e))
        fail_msg("%s", e.text);
}

static void flip_byte(const char *name, long at)
{
    FILE *f = fopen(in_folder(name), "r+b");
    assert_non_null(f);
    fseek(f, at, SEEK_SET);
    const int old = fgetc(f);
    fseek(f, at, SEEK_SET);
    fputc(old ^ 1, f);
    fclose(f);
}

static void training_reaches_its_accuracy(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    read_config(&c, (const char *const[]){"train.patience=0"}, 1);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    // Far below the error of the mean map (about 1 mm); the model states the measured accuracy.
    assert_true(r.accuracy.rmse_mm > 0 && r.accuracy.rmse_mm < 0.03);
    assert_true(r.accuracy.q50_mm <= r.accuracy.q90_mm && r.accuracy.q90_mm <= r.accuracy.q99_mm);
    assert_int_equal(r.steps, 1200);
    assert_int_equal(r.samples, 9 + 150 + 100);
    assert_true(exists("model.sdm") && exists("config.yaml") && exists("metrics.jsonl") &&
                exists("loss.png"));

    sdm_model *m;
    assert_int_equal(sdm_model_open(r.model_path, &m, &e), SDM_OK);
    const sdm_model_info *info = sdm_model_get_info(m);
    assert_true(info->accuracy.rmse_mm == r.accuracy.rmse_mm);
    assert_string_equal(info->shape, "capsule");
    // An independent measurement: new shapes, compared with the exact engine.
    const size_t n = sdm_grid_count(&c.grid);
    float *map, *truth;
    void *scratch;
    assert_int_equal(SDM_ALLOC(&map, n, "map", NULL), 0);
    assert_int_equal(SDM_ALLOC(&truth, n, "truth", NULL), 0);
    assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
    double sum = 0;
    for (uint64_t i = 0; i < 10; i++) {
        double lo[8], hi[8], p[8];
        sdm_distribution of[8];
        sdm_mesh mesh = {0};
        sdm_exact *exact;
        assert_int_equal(sdm_train_ranges(&c, capsule, lo, hi, &e), SDM_OK);
        assert_int_equal(sdm_train_distributions(&c, capsule, lo, hi, of, &e), SDM_OK);
        sdm_sample_params(99, 12345, i, lo, hi, of, info->n_params, p);
        assert_int_equal(sdm_instance_mesh(capsule, p, &mesh, &e), SDM_OK);
        assert_int_equal(sdm_exact_create(&mesh, NULL, &exact, &e), SDM_OK);
        assert_int_equal(sdm_exact_map(exact, &c.grid, truth, &e), SDM_OK);
        sdm_model_forward(m, p, 1, map, scratch);
        for (size_t v = 0; v < n; v++)
            sum += ((double)map[v] - truth[v]) * ((double)map[v] - truth[v]);
        sdm_exact_free(exact);
        sdm_mesh_dispose(&mesh);
    }
    assert_true(sqrt(sum / 10 / (double)n) < 2 * r.accuracy.rmse_mm);
    sdm_free(map);
    sdm_free(truth);
    sdm_free(scratch);
    sdm_model_free(m);
}

static void same_bits_for_threads(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    uint64_t model[3], metrics[3];
    for (int threads = 1; threads <= 3; threads++) {
        read_config(&c, (const char *const[]){"train.steps=600"}, 1);
        run_files_remove();
        // The stored configuration must not contain the number of threads, since results do not
        // depend on it.
        c.threads = 0;
        c.data.workers = threads;
        sdm_config run = c;
        run.threads = threads;
        run.data.workers = threads;
        if (sdm_train(&run, capsule, folder, false, NULL, NULL, &e)) fail_msg("%s", e.text);
        model[threads - 1] = hash_of("model.sdm");
        metrics[threads - 1] = hash_of("metrics.jsonl");
    }
    assert_true(model[0] == model[1] && model[1] == model[2]);
    assert_true(metrics[0] == metrics[1] && metrics[1] == metrics[2]);
}

typedef struct watch {
    int64_t stop_at;
    int64_t step;
    int reports;
} watch;

static void watch_progress(void *user, const sdm_progress *p)
{
    watch *w = user;
    w->step = p->step;
    w->reports++;
}

static atomic_llong calls; // of the hook, by any thread
static int64_t stop_after;
// Number of calls of the hook until each phase, for 600 steps.
enum { IN_DATA = 20, IN_FIT = 400, IN_REFINEMENT = 700 };

static bool stop(void *user)
{
    (void)user;
    return ++calls > stop_after;
}

// A checkpoint of a run of c exists: a damaged one and another configuration are refused.
static void bad_resume_check(const sdm_config *c)
{
    sdm_error e = {0};
    // A changed byte.
    flip_byte("checkpoint.sdmc", 100000);
    assert_int_equal(sdm_train(c, capsule, folder, true, NULL, NULL, &e), SDM_E_FORMAT);
    flip_byte("checkpoint.sdmc", 100000);
    // Another configuration.
    sdm_config other;
    read_config(&other, (const char *const[]){"train.steps=600", "network.rank=5"}, 2);
    assert_int_equal(sdm_train(&other, capsule, folder, true, NULL, NULL, &e), SDM_E_CONFIG);
}

static void resume_is_bit_exact(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    read_config(&c, (const char *const[]){"train.steps=600"}, 1);
    run_files_remove();
    if (sdm_train(&c, capsule, folder, false, NULL, NULL, &e)) fail_msg("%s", e.text);
    const uint64_t whole = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl");
    // Stopped while data are made, in the fit of the network, in the refinement.
    const int64_t stops[] = {IN_DATA, IN_FIT, IN_REFINEMENT};
    for (size_t i = 0; i < 3; i++) {
        run_files_remove();
        atomic_store(&calls, 0), stop_after = stops[i];
        watch w = {0};
        const sdm_train_hooks hooks = {.cancelled = stop, .progress = watch_progress, .user = &w};
        assert_int_equal(sdm_train(&c, capsule, folder, false, &hooks, NULL, &e), SDM_E_CANCELLED);
        assert_false(exists("model.sdm"));
        assert_true(exists("checkpoint.sdmc") == (i > 0));
        if (i == 2) bad_resume_check(&c);
        if (sdm_train(&c, capsule, folder, true, NULL, NULL, &e)) fail_msg("%s", e.text);
        assert_true(hash_of("model.sdm") == whole);
        assert_true(hash_of("metrics.jsonl") == metrics);
        assert_true(w.reports > 0);
        // The checkpoint is removed after a complete run.
        assert_false(exists("checkpoint.sdmc"));
    }
}

static bool old_files;

static bool old_files_watch(void *user)
{
    (void)user;
    if (++calls == IN_FIT) old_files = exists("model.sdm") || exists("checkpoint.sdmc");
    return false;
}

// Resuming with another budget uses the new one, unless it ends before the step already reached.
static void resume_with_another_budget(void **state)
{
    (void)state;
    static const char *const budgets[][3] = {
        // Budgets: of the stopped run, too small to resume, large enough.
        {"train.steps=600", "train.steps=300", "train.steps=540"},
        {"train.steps=600", "train.steps=300", "train.steps=900"},
        {"train.minutes=1000", "train.minutes=0.00001", NULL}};
    for (size_t i = 0; i < 3; i++) {
        sdm_config c;
        sdm_error e = {0};
        sdm_train_report r;
        run_files_remove();
        read_config(&c, (const char *const[]){budgets[i][0]}, 1);
        atomic_store(&calls, 0), stop_after = i < 2 ? IN_REFINEMENT : IN_FIT;
        const sdm_train_hooks hooks = {.cancelled = stop};
        assert_int_equal(sdm_train(&c, capsule, folder, false, &hooks, NULL, &e), SDM_E_CANCELLED);
        read_config(&c, (const char *const[]){budgets[i][1]}, 1);
        assert_int_equal(sdm_train(&c, capsule, folder, true, NULL, NULL, &e), SDM_E_CONFIG);
        assert_non_null(strstr(e.text, "this configuration ends at"));
        if (!budgets[i][2]) continue;
        read_config(&c, (const char *const[]){budgets[i][2]}, 1);
        if (sdm_train(&c, capsule, folder, true, NULL, &r, &e)) fail_msg("%s", e.text);
        assert_int_equal(r.steps, c.train.steps);
    }
}

static bool block_model(void *user)
{
    (void)user;
    if (++calls == IN_FIT) assert_int_equal(mkdir(in_folder("model.sdm"), 0700), 0);
    return false;
}

// If the model file cannot be written, the trained network can still be saved by resuming from the
// checkpoint.
static void model_cannot_be_written(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    read_config(&c, (const char *const[]){"train.steps=595"}, 1);
    run_files_remove();
    if (sdm_train(&c, capsule, folder, false, NULL, NULL, &e)) fail_msg("%s", e.text);
    const uint64_t whole = hash_of("model.sdm"), metrics = hash_of("metrics.jsonl");
    run_files_remove();
    calls = 0;
    const sdm_train_hooks hooks = {.cancelled = block_model};
    assert_int_equal(sdm_train(&c, capsule, folder, false, &hooks, NULL, &e), SDM_E_IO);
    assert_non_null(strstr(e.text, "model.sdm: cannot write"));
    assert_int_equal(rmdir(in_folder("model.sdm")), 0);
    // Enough calls to make the data again, but no training step.
    atomic_store(&calls, 0), stop_after = 2 * IN_DATA + 300;
    const sdm_train_hooks no_step = {.cancelled = stop};
    if (sdm_train(&c, capsule, folder, true, &no_step, NULL, &e)) fail_msg("%s", e.text);
    assert_true(hash_of("model.sdm") == whole && hash_of("metrics.jsonl") == metrics);
}

// The files of an older run stay until training begins and are then removed, so that its checkpoint
// cannot be mistaken for one of the new run.
static void older_run_gives_way(void **state)
{
    (void)state;
    sdm_config c, other;
    sdm_error e = {0};
    read_config(&c, (const char *const[]){"train.steps=600"}, 1);
    read_config(&other, (const char *const[]){"train.steps=600", "network.width=16"}, 2);
    run_files_remove();
    const sdm_train_hooks stopped = {.cancelled = stop};
    atomic_store(&calls, 0), stop_after = IN_FIT;
    assert_int_equal(sdm_train(&c, capsule, folder, false, &stopped, NULL, &e), SDM_E_CANCELLED);
    const uint64_t config = hash_of("config.yaml"), checkpoint = hash_of("checkpoint.sdmc");
    atomic_store(&calls, 0), stop_after = IN_DATA;
    assert_int_equal(sdm_train(&other, capsule, folder, false, &stopped, NULL, &e),
                     SDM_E_CANCELLED);
    assert_true(hash_of("config.yaml") == config && hash_of("checkpoint.sdmc") == checkpoint);
    // First the older run left a checkpoint, then a model.
    const sdm_train_hooks looking = {.cancelled = old_files_watch};
    for (int i = 0; i < 2; i++) {
        atomic_store(&calls, 0), old_files = true;
        if (sdm_train(i ? &c : &other, capsule, folder, false, &looking, NULL, &e))
            fail_msg("%s", e.text);
        assert_false(old_files);
        assert_true((hash_of("config.yaml") == config) == (i == 1));
    }
}

// A folder that cannot be written is detected before any work.
static void unwritable_folder_is_found_early(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    read_config(&c, NULL, 0);
    atomic_store(&calls, 0), stop_after = 0;
    const sdm_train_hooks hooks = {.cancelled = stop};
    assert_int_equal(sdm_train(&c, capsule, "/proc", false, &hooks, NULL, &e), SDM_E_IO);
}

// A time budget that ends before all data are made still gives a model.
static void time_budget_shorter_than_data(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    run_files_remove();
    read_config(&c,
                (const char *const[]){"train.steps=0", "train.minutes=0.01", "data.start=5000",
                                      "network.degree=8"},
                4);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    assert_true(r.accuracy.rmse_mm < 0.2 && r.samples < 5000);
}

static void polynomials_without_hidden_layers(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    run_files_remove();
    read_config(&c,
                (const char *const[]){"network.depth=0", "train.steps=50", "network.weights=f32",
                                      "data.static=[2,4]", "data.online=0", "train.loss=huber",
                                      "train.near_weight=2"},
                7);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    if (!(r.accuracy.rmse_mm < 0.3)) fail_msg("RMSE %g mm", r.accuracy.rmse_mm);
}

// More samples than fit into memory: new ones replace the oldest.
static void small_pool_replaces_old_samples(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    run_files_remove();
    read_config(&c,
                (const char *const[]){"train.steps=300", "data.memory_gb=0.0025", "data.start=60",
                                      "data.online=500", "data.static=2"},
                5);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    assert_int_equal(r.samples, 4 + 560);
    if (!(r.accuracy.rmse_mm < 0.3)) fail_msg("RMSE %g mm", r.accuracy.rmse_mm);
}

// n maps span at most n basis functions, so a larger configured rank has no effect.
static void rank_is_limited_by_maps(void **state)
{
    (void)state;
    enum { MAPS = 8 };
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    sdm_model *m;
    run_files_remove();
    read_config(&c,
                (const char *const[]){"train.steps=2", "data.static=2", "data.start=4",
                                      "data.online=0", "network.rank=200", "network.levels=1"},
                6);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    assert_int_equal(r.samples, MAPS);
    assert_int_equal(sdm_model_open(r.model_path, &m, &e), SDM_OK);
    const size_t blocks = sdm_pod_count(&c.grid, (size_t)c.network.block, 1).first[1];
    const double latent = 24 + 20, voxels = (double)sdm_grid_count(&c.grid),
                 mlp = 24 * (24 + 20); // upper bound
    assert_true(sdm_model_get_info(m)->macs <=
                (double)MAPS * ((double)blocks * latent + voxels) + mlp);
    sdm_model_free(m);
}

static void length_is_normal(const void *self, sdm_distribution *out)
{
    (void)self;
    out[1] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 3.5, 0.75};
}

static void resolve(const sdm_instance *s, const char *override, sdm_distribution out[2])
{
    sdm_config c;
    sdm_error e = {0};
    double lo[2], hi[2];
    read_config(&c, &override, override != NULL);
    if (sdm_train_ranges(&c, s, lo, hi, &e) || sdm_train_distributions(&c, s, lo, hi, out, &e))
        fail_msg("%s", e.text);
}

static void assert_normal(const sdm_distribution *d, double mean, double deviation)
{
    assert_int_equal(d->kind, SDM_DISTRIBUTION_NORMAL);
    assert_true(fabs(d->mean - mean) < 1e-14 && fabs(d->deviation - deviation) < 1e-14);
}

// The configuration's word, the shape's statement and the ranges together give the distribution.
static void distributions_are_resolved(void **state)
{
    (void)state;
    sdm_shape shape = *sdm_instance_shape(capsule);
    sdm_instance *normal = NULL;
    shape.distributions = length_is_normal;
    assert_int_equal(sdm_instance_create(&shape, NULL, 0, NULL, &normal, NULL), SDM_OK);
    const sdm_param *params = sdm_instance_params(capsule, NULL);
    const double quarter[2] = {0.25 * (params[0].max - params[0].min),
                               0.25 * (params[1].max - params[1].min)};
    sdm_distribution d[2];
    resolve(capsule, NULL, d);
    for (int k = 0; k < 2; k++) assert_int_equal(d[k].kind, SDM_DISTRIBUTION_UNIFORM);
    resolve(capsule, "shape.distribution=normal", d);
    for (int k = 0; k < 2; k++) assert_normal(&d[k], params[k].def, quarter[k]);
    resolve(normal, NULL, d);
    assert_normal(&d[1], 3.5, 0.75);
    assert_int_equal(d[0].kind, SDM_DISTRIBUTION_UNIFORM);
    resolve(normal, "shape.distribution=normal", d);
    assert_normal(&d[1], 3.5, 0.75);
    assert_normal(&d[0], params[0].def, quarter[0]);
    resolve(normal, "shape.distribution=uniform", d);
    for (int k = 0; k < 2; k++) assert_int_equal(d[k].kind, SDM_DISTRIBUTION_UNIFORM);
    resolve(normal, "shape.distribution.radius={mean: 1.4, deviation: 0.1}", d);
    assert_normal(&d[1], 3.5, 0.75);
    assert_normal(&d[0], 1.4, 0.1);
    // the default value of a narrower range is the nearest value in it
    char text[128];
    const double low = params[0].def + 0.1, high = params[0].def + 0.3;
    snprintf(text, sizeof text, "shape={ranges: {radius: [%.17g, %.17g]}, distribution: normal}",
             low, high);
    resolve(capsule, text, d);
    assert_normal(&d[0], low, 0.25 * (high - low));
    sdm_instance_free(normal);
}

// Held-out and random training shapes follow the distribution; the static grid stays regular.
static void maps_follow_the_distribution(void **state)
{
    (void)state;
    enum { HOLDOUT = 20, START = 60, STATIC = 9 };
    static const char *const keys[] = {"data={static: 3, start: 60, online: 0, holdout: 20}",
                                       "grid={size: [4, 4, 4], spacing: 3}",
                                       "shape.distribution.radius={mean: 1.3, deviation: 0.01}"};
    sdm_config c;
    sdm_error e = {0};
    read_config(&c, keys, 3);
    dataset d = {.shape = capsule, .grid = &c.grid, .n_voxels = 64, .seed = 3};
    sdm_instance_params(capsule, &d.n_params);
    if (sdm_train_ranges(&c, capsule, d.min, d.max, &e) ||
        sdm_train_distributions(&c, capsule, d.min, d.max, d.distribution, &e) ||
        trainer_dataset_size(&d, &c, &e) || trainer_dataset_create(&d, &c, &e))
        fail_msg("%s", e.text);
    const sdm_pod_levels levels = sdm_pod_count(&c.grid, 4, 1);
    sdm_pod_block block;
    assert_int_equal(levels.first[1], 1);
    sdm_pod_blocks(&c.grid, 4, &levels, &block);
    d.blocks = &block, d.n_blocks = 1;
    const fill_hooks none = {0};
    if (trainer_dataset_fill(&d, 1, &none, &e)) fail_msg("%s", e.text);
    double far = 0;
    for (size_t i = 0; i < HOLDOUT; i++) far = fmax(far, fabs(d.holdout_params[2 * i] - 1.3));
    for (size_t i = STATIC; i < STATIC + START; i++) far = fmax(far, fabs(d.params[2 * i] - 1.3));
    assert_true(far > 0.01 && far < 0.05);
    for (size_t i = 0; i < STATIC; i++)
        assert_true(d.params[2 * i] == 0.5 + 1.25 * (double)(i % 3));
    trainer_dataset_dispose(&d);
}

static void model_tells_its_distributions(void **state)
{
    (void)state;
    sdm_config c;
    sdm_model *m;
    sdm_error e = {0};
    run_files_remove();
    read_config(&c,
                (const char *const[]){"train.steps=10",
                                      "shape.distribution.radius={mean: 1.3, deviation: 0.01}"},
                2);
    if (sdm_train(&c, capsule, folder, false, NULL, NULL, &e)) fail_msg("%s", e.text);
    assert_int_equal(sdm_model_open(in_folder("model.sdm"), &m, &e), SDM_OK);
    const sdm_model_info *info = sdm_model_get_info(m);
    assert_int_equal(info->params[1].distribution.kind, SDM_DISTRIBUTION_UNIFORM);
    assert_normal(&info->params[0].distribution, 1.3, 0.01);
    assert_non_null(strstr(info->config, "radius: {mean: 1.3, deviation: 0.01}"));
    sdm_model_free(m);
}

static void mistakes_are_refused(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    run_files_remove();
    read_config(&c, (const char *const[]){"data.static=[2,2,2,2,2]"}, 1);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_CONFIG);
    assert_non_null(strstr(e.text, "data.static"));
    read_config(&c, (const char *const[]){"data.memory_gb=0.001"}, 1);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_CONFIG);
    assert_non_null(strstr(e.text, "data.memory_gb"));
    read_config(&c, (const char *const[]){"shape.ranges.radios=[1,2]"}, 1);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_CONFIG);
    assert_non_null(strstr(e.text, "did you mean 'radius'"));
    read_config(&c, (const char *const[]){"shape.ranges.radius=[1e-9,1e9]"}, 1);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_CONFIG);
    read_config(&c, (const char *const[]){"shape.distribution.radios=normal"}, 1);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_CONFIG);
    assert_string_equal(e.text, "argument 'shape.distribution.radios=normal': shape 'capsule' has "
                                "no parameter 'radios'; did you mean 'radius'?");
    read_config(&c, (const char *const[]){"shape.distribution.radius={mean: 99, deviation: 1}"}, 1);
    assert_int_equal(sdm_train(&c, capsule, folder, false, NULL, NULL, &e), SDM_E_CONFIG);
    assert_non_null(strstr(e.text, "': distribution of 'radius': a normal distribution of mean 99 "
                                   "and deviation 1 has no values in the range"));
    read_config(&c, NULL, 0);
    assert_int_equal(sdm_train(&c, capsule, "/proc/no/such/folder", false, NULL, NULL, &e),
                     SDM_E_IO);
    assert_false(exists("model.sdm"));
}

/* Maps at three values of a parameter determine no cubic in it, however many they are: the training
 * takes polynomials that they do determine. */
static void maps_at_few_values_train(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    const char *const overrides[] = {"data={static: [3, 40], start: 0, online: 0, holdout: 20}",
                                     "network.degree=6", "train={steps: 5, refine: 0}"};
    read_config(&c, overrides, sizeof overrides / sizeof *overrides);
    if (sdm_train(&c, capsule, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    if (!(r.accuracy.rmse_mm < 0.3)) fail_msg("RMSE %g mm", r.accuracy.rmse_mm);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(training_reaches_its_accuracy),
                                       cmocka_unit_test(same_bits_for_threads),
                                       cmocka_unit_test(resume_is_bit_exact),
                                       cmocka_unit_test(resume_with_another_budget),
                                       cmocka_unit_test(model_cannot_be_written),
                                       cmocka_unit_test(older_run_gives_way),
                                       cmocka_unit_test(unwritable_folder_is_found_early),
                                       cmocka_unit_test(time_budget_shorter_than_data),
                                       cmocka_unit_test(polynomials_without_hidden_layers),
                                       cmocka_unit_test(small_pool_replaces_old_samples),
                                       cmocka_unit_test(rank_is_limited_by_maps),
                                       cmocka_unit_test(maps_at_few_values_train),
                                       cmocka_unit_test(distributions_are_resolved),
                                       cmocka_unit_test(maps_follow_the_distribution),
                                       cmocka_unit_test(model_tells_its_distributions),
                                       cmocka_unit_test(mistakes_are_refused)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
