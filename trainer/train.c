/* A training run from config to model file. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "export_model.h"
#include "kind.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/file.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

double trainer_seconds(const trainer *t) { return sdm_clock() - t->started; }

bool trainer_by_time(const trainer *t) { return t->config->train.minutes > 0; }

int64_t trainer_steps(const trainer *t)
{
    const sdm_config *c = t->config;
    return c->train.steps > 0 ? c->train.steps
                              : (c->train.samples + c->train.batch - 1) / c->train.batch;
}

double trainer_fraction(const trainer *t)
{
    if (trainer_by_time(t)) return trainer_seconds(t) / (t->config->train.minutes * 60);
    return (double)t->step / (double)trainer_steps(t);
}

// threads that make online samples
static int worker_count(const trainer *t)
{
    if (t->config->data.workers > 0) return t->config->data.workers;
    return t->n_threads > 1 ? t->n_threads / 2 : 1;
}

int trainer_threads(const trainer *t)
{
    if (!t->producer) return t->n_threads;
    const int workers = worker_count(t);
    return workers < t->n_threads ? t->n_threads - workers : 1;
}

void trainer_report(trainer *t, double fraction, double samples_per_second, bool now)
{
    const double seconds = trainer_seconds(t);
    if (!t->hooks.progress || (!now && seconds - t->last_report < 0.1)) return;
    t->last_report = seconds;
    const double all = trainer_by_time(t) ? t->config->train.minutes * 60
                       : fraction > 0     ? seconds / fraction
                                          : NAN;
    const sdm_progress p = {.phase = t->phase,
                            .fraction = fraction < 1 ? fraction : 1,
                            .step = t->step,
                            .samples = (int64_t)(t->data.n_static + t->data.n_taken),
                            .loss = t->loss,
                            .heldout_rmse_mm = sqrt(t->heldout_mse),
                            .samples_per_second = samples_per_second,
                            .seconds = seconds,
                            .seconds_left = all > seconds ? all - seconds : 0};
    t->hooks.progress(t->hooks.user, &p);
}

void trainer_message(trainer *t, const char *fmt, ...)
{
    if (!t->hooks.message) return;
    char line[1024];
    va_list args;
    va_start(args, fmt);
    vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    t->hooks.message(t->hooks.user, line);
}

bool trainer_cancelled(const trainer *t)
{
    return t->hooks.cancelled && t->hooks.cancelled(t->hooks.user);
}

sdm_status trainer_stop(trainer *t, sdm_error *err)
{
    const sdm_status s = checkpoint_write(t, err);
    if (s) return s;
    return sdm_fail(err, SDM_E_CANCELLED,
                    "stopped on request at step %lld; a checkpoint is in %s: go on with --resume",
                    (long long)t->step, t->folder);
}

// writes all lines so far: the file is complete at any moment, and after a resume it has no line
// twice
static sdm_status write_metrics(const trainer *t, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/metrics.jsonl", t->folder);
    sdm_outfile *f;
    sdm_status s = sdm_outfile_open(path, &f, err);
    if (s) return s;
    s = sdm_outfile_write(f, t->metrics->data ? t->metrics->data : "", t->metrics->size, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}

sdm_status trainer_metric(trainer *t, double rate, sdm_error *err)
{
    static const char *const phases[] = {"data", "bases", "fit", "refine", "evaluate"};
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", phases[t->phase]);
    sdm_json_int(&j, "step", t->step);
    sdm_json_int(&j, "maps", (int64_t)(t->data.n_static + t->data.n_taken));
    sdm_json_real(&j, "loss_mm2", t->loss);
    sdm_json_real(&j, "heldout_mse_mm2", t->heldout_mse);
    sdm_json_real(&j, "learning_rate", rate);
    if (trainer_by_time(t))
        sdm_json_real(&j, "seconds",
                      trainer_seconds(t)); // else the file is the same bits in every run
    sdm_json_close(&j, '}');
    if (!j.text.failed) sdm_text_add(t->metrics, "%s\n", j.text.data);
    const bool failed = j.text.failed || t->metrics->failed;
    sdm_json_dispose(&j);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the metrics") : write_metrics(t, err);
}

static sdm_status take(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    return t->kind->take ? t->kind->take(t, slots, n, err) : SDM_OK;
}

// what the network does not know of n new samples, which it has not trained on, says where more are
// needed
static sdm_status plan_ahead(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    double error[SAMPLE_ROUND];
    dataset *d = &t->data;
    if (!d->plan.by_error) return SDM_OK;
    sdm_status s = SDM_OK;
    if (t->phase == SDM_PHASE_FIT) {
        s = t->kind->errors(t, slots, n, error, err);
        if (!s) sample_plan_observe(&d->plan, d->n_taken - n, n, error);
    }
    const sample_space space = dataset_space(d);
    if (!s) s = sample_plan_extend(&d->plan, &space, d->n_start, d->n_taken, err);
    producer_allow(t->producer, d->plan.n_planned);
    return s;
}

sdm_status trainer_take_samples(trainer *t, size_t wanted, sdm_error *err)
{
    enum { GROUP = SAMPLE_ROUND };
    if (!t->producer) return SDM_OK;
    dataset *d = &t->data;
    const size_t all = d->n_start + d->n_online;
    size_t until;
    if (trainer_by_time(t)) {
        const size_t ready = producer_ready(t->producer);
        if (ready < GROUP && d->n_taken + ready < all) return SDM_OK;
        until = d->n_taken + ready;
    } else {
        until = wanted >= all ? all : d->n_start + (wanted - d->n_start) / GROUP * GROUP;
    }
    while (d->n_taken < until) {
        size_t slots[GROUP], n = until - d->n_taken < GROUP ? until - d->n_taken : GROUP;
        for (size_t i = 0; i < n; i++) slots[i] = dataset_slot(d, d->n_taken + i);
        sdm_status s = producer_take(t->producer, d->n_taken + n, err);
        if (!s) s = take(t, slots, n, err);
        if (!s) s = plan_ahead(t, slots, n, err);
        if (s) return s;
        if (d->n_taken < until) { // a long wait: show it, and let it be stopped
            trainer_report(t, trainer_fraction(t), 0, false);
            if (trainer_cancelled(t)) return SDM_OK;
        }
    }
    if (d->n_taken == all) {
        producer_stop(t->producer);
        t->producer = NULL;
    }
    return SDM_OK;
}

sdm_status sdm_train_ranges(const sdm_config *config, const sdm_instance *shape, double *min,
                            double *max, sdm_error *err)
{
    size_t n;
    const sdm_param *params = sdm_instance_params(shape, &n);
    char where[1200];
    for (size_t i = 0; i < n; i++) min[i] = params[i].min, max[i] = params[i].max;
    for (size_t r = 0; r < config->shape.n_ranges; r++) {
        const sdm_config_range *range = &config->shape.ranges[r];
        const int i = sdm_instance_param_index(shape, range->name);
        sdm_config_where(config, range->mark, where);
        if (i < 0) {
            const char *names[SDM_MAX_PARAMS];
            for (size_t k = 0; k < n && k < SDM_MAX_PARAMS; k++) names[k] = params[k].name;
            const char *near =
                sdm_nearest_name(range->name, names, n < SDM_MAX_PARAMS ? n : SDM_MAX_PARAMS);
            return sdm_fail(err, SDM_E_CONFIG, "%s: shape '%s' has no parameter '%s'%s%s%s", where,
                            sdm_instance_shape(shape)->name, range->name,
                            near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
        }
        if (!(range->min >= params[i].min && range->max <= params[i].max &&
              range->min < range->max))
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s: range [%g, %g] of '%s' must lie within [%g, %g] of shape '%s'",
                            where, range->min, range->max, range->name, params[i].min,
                            params[i].max, sdm_instance_shape(shape)->name);
        min[i] = range->min, max[i] = range->max;
    }
    return SDM_OK;
}

// shape, grid, sizes of the data
static sdm_status set_up(trainer *t, sdm_error *err)
{
    const sdm_config *c = t->config;
    dataset *d = &t->data;
    sdm_instance_params(t->shape, &d->n_params);
    if (d->n_params > SDM_POD_MAX_PARAMS)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%zu parameters, at most %d can be trained",
                        d->n_params, SDM_POD_MAX_PARAMS);
    sdm_status s = export_prepare(t, err);
    if (!s) s = sdm_train_ranges(c, t->shape, d->min, d->max, err);
    if (s) return s;
    d->shape = t->shape;
    d->grid = &c->grid;
    d->seed = c->seed;
    d->n_voxels = sdm_grid_count(&c->grid);
    if ((s = dataset_create(d, c, err)))
        return s; // first: it says what a grid that is too large needs
    size_t block = t->kind->block(c);
    for (int i = 0; i < 3 && !t->kind->block(c); i++)
        if ((size_t)c->grid.n[i] > block) block = (size_t)c->grid.n[i];
    t->levels = sdm_pod_count(&c->grid, block, t->kind->levels ? t->kind->levels(c) : 1);
    d->n_blocks = t->levels.first[1];
    if ((s = SDM_ALLOC(&t->blocks, t->levels.first[t->levels.n], "blocks", err))) return s;
    sdm_pod_blocks(&c->grid, block, &t->levels, t->blocks);
    d->blocks = t->blocks;
    return SDM_OK;
}

static void report_fill(void *user, size_t done, size_t all)
{
    trainer *t = user;
    // the share of the data in the whole is not known: the clock tells it in time mode
    const double f =
        trainer_by_time(t) ? trainer_seconds(t) / (t->config->train.minutes * 60) : 0.0;
    t->data.n_taken = done > t->data.n_holdout + t->data.n_static
                          ? done - t->data.n_holdout - t->data.n_static
                          : 0;
    trainer_report(t, f, (double)done / (trainer_seconds(t) + 1e-9), done == all);
}

// a grid that no held-out shape reaches would give a network of excellent figures and no use
static sdm_status check_grid(const trainer *t, sdm_error *err)
{
    const dataset *d = &t->data;
    for (size_t i = 0; i < d->n_holdout * d->n_voxels; i++)
        if (d->holdout[i] < 0) return SDM_OK;
    return sdm_fail(
        err, SDM_E_CONFIG,
        "%s: no voxel of the grid is inside any of %zu held-out shapes: check grid.centre (or "
        "grid.origin), grid.size and "
        "grid.spacing",
        t->config->file, d->n_holdout);
}

static bool cancelled(void *user) { return trainer_cancelled(user); }

// half of a time budget is enough for data; a resumed run makes the data it had
static bool enough(void *user)
{
    const trainer *t = user;
    return trainer_by_time(t) && trainer_seconds(t) > 0.5 * t->config->train.minutes * 60;
}

static sdm_status start_producer(trainer *t, sdm_error *err)
{
    const dataset *d = &t->data;
    if (d->n_taken >= d->n_start + d->n_online) return SDM_OK;
    return producer_start(&t->data, d->n_taken, worker_count(t), &t->producer, err);
}

// the samples that a resumed run had taken, made again
static sdm_status retake(trainer *t, size_t n_taken, sdm_error *err)
{
    while (t->producer && t->data.n_taken < n_taken) {
        size_t slots[32], n = n_taken - t->data.n_taken < 32 ? n_taken - t->data.n_taken : 32;
        for (size_t i = 0; i < n; i++) slots[i] = dataset_slot(&t->data, t->data.n_taken + i);
        sdm_status s = producer_take(t->producer, t->data.n_taken + n, err);
        if (!s) s = take(t, slots, n, err);
        if (!s && trainer_cancelled(t)) s = sdm_fail(err, SDM_E_CANCELLED, "stopped on request");
        if (s) return s;
        trainer_report(t, 0, 0, false);
    }
    return SDM_OK;
}

void trainer_enter(trainer *t, sdm_phase phase)
{
    t->phase = phase;
    t->phase_step = 0;
    t->phase_started = trainer_seconds(t);
}

// from here on the folder is this run's: checkpoint and model of an older one would contradict its
// configuration
static sdm_status take_folder(const trainer *t, bool resume, sdm_outfile **config, sdm_error *err)
{
    const sdm_status s = resume ? SDM_OK : checkpoint_start_anew(t, err);
    return s ? s : sdm_outfile_commit(config, err);
}

// config: the resolved configuration, under its temporary name until all that can refuse it has
// been passed
static sdm_status run(trainer *t, bool resume, sdm_outfile **config, sdm_error *err)
{
    bool found = false;
    sdm_phase from = SDM_PHASE_FIT;
    size_t n_taken = 0;
    sdm_status s = set_up(t, err);
    if (!s && resume) {
        s = checkpoint_read(t, &found, err);
        if (!s && !found)
            trainer_message(t, "no checkpoint in %s: training starts from the beginning",
                            t->folder);
        if (found) from = t->phase, n_taken = t->data.n_taken;
    }
    const double resumed_seconds = trainer_seconds(t);
    t->phase = SDM_PHASE_DATA;
    const size_t start = t->data.n_start;
    const fill_hooks hooks = {
        .report = report_fill, .cancelled = cancelled, .enough = found ? NULL : enough, .user = t};
    if (!s) s = dataset_fill(&t->data, t->n_threads, &hooks, err);
    if (!s && t->data.n_start < start)
        trainer_message(t,
                        "half of the budget is over after %zu of %zu random maps: training starts "
                        "with these (lower "
                        "data.start or raise "
                        "train.minutes)",
                        t->data.n_start, start);
    if (!s) s = check_grid(t, err);
    t->phase = SDM_PHASE_BASES;
    trainer_report(t, trainer_by_time(t) ? trainer_seconds(t) / (t->config->train.minutes * 60) : 0,
                   0, true);
    if (!s) s = t->kind->begin(t, err);
    if (!s) s = start_producer(t, err);
    if (!s && found) s = retake(t, n_taken, err);
    if (s == SDM_E_CANCELLED)
        s = sdm_fail(err, s, "stopped on request before the training began: %s is as it was",
                     t->folder);
    if (!s) s = take_folder(t, resume, config, err);
    if (s) return s;

    if (found) {
        t->started += trainer_seconds(t) - resumed_seconds; // making the data again does not count
        t->phase = from;
    } else {
        trainer_enter(t, SDM_PHASE_FIT);
    }
    t->last_checkpoint = trainer_seconds(t);
    return t->kind->run(t, found, err);
}

// a network that cannot be written leaves a checkpoint
static sdm_status finish(trainer *t, sdm_train_report *report, sdm_error *err)
{
    const sdm_phase phase = t->phase;
    const size_t lines = t->metrics->size;
    t->phase = SDM_PHASE_EVALUATE;
    trainer_report(t, 1, 0, true);
    const sdm_status s = export_model(t, report, err);
    if (!s) return checkpoint_remove(t, err);
    t->phase = phase;
    t->metrics->size = lines;
    if (s != SDM_E_QUALITY && !checkpoint_write(t, NULL))
        trainer_message(t, "a checkpoint is in %s: go on with --resume", t->folder);
    return s;
}

sdm_status sdm_train(const sdm_config *config, const sdm_instance *shape, const char *folder,
                     bool resume, const sdm_train_hooks *hooks, sdm_train_report *report,
                     sdm_error *err)
{
    sdm_text metrics = {0};
    trainer t = {.config = config,
                 .shape = shape,
                 .folder = folder,
                 .kind = config->network.kind == SDM_NETWORK_POD ? &pod_train : &direct_train,
                 .started = sdm_clock(),
                 .loss = NAN,
                 .heldout_mse = NAN,
                 .metrics = &metrics};
    if (hooks) t.hooks = *hooks;
    t.n_threads = sdm_threads(config->threads);
    sdm_outfile *resolved = NULL;
    sdm_status s = sdm_make_folder(folder, err);
    if (!s) s = export_config(&t, &resolved, err);
    if (!s) s = run(&t, resume, &resolved, err);
    sdm_outfile_discard(&resolved);
    producer_stop(t.producer);
    t.producer = NULL;
    if (!s) s = finish(&t, report, err);
    t.kind->dispose(&t);
    dataset_dispose(&t.data);
    sdm_free(t.blocks);
    sdm_text_dispose(&metrics);
    return s;
}
