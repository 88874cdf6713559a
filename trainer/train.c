/* A training run from beginning to end: maps, network, training, model file. */
#include <math.h>
#include <string.h>

#include "data/dataset_fill.h"
#include "direct/direct.h"
#include "pod/pod_kind.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/team.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "state/checkpoint.h"
#include "state/export_model.h"
#include "state/kind.h"
#include "state/new_samples.h"
#include "state/progress.h"

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
        // no such parameter: suggest the most similar name
        if (i < 0) {
            const char *names[SDM_MAX_PARAMS];
            for (size_t k = 0; k < n && k < SDM_MAX_PARAMS; k++) names[k] = params[k].name;
            const char *near =
                sdm_nearest_name(range->name, names, n < SDM_MAX_PARAMS ? n : SDM_MAX_PARAMS);
            return sdm_fail(err, SDM_E_CONFIG, "%s: shape '%s' has no parameter '%s'%s%s%s", where,
                            sdm_instance_shape(shape)->name, range->name,
                            near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
        }
        // narrowing is allowed, widening is not
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

/* Checks the shape against the configuration; allocates the data set and the blocks of its maps. */
static sdm_status train_set_up(trainer *t, sdm_error *err)
{
    const sdm_config *c = t->config;
    dataset *d = &t->data;
    sdm_instance_params(t->shape, &d->n_params);
    if (d->n_params > SDM_POD_MAX_PARAMS)
        return sdm_fail(err, SDM_E_UNSUPPORTED, "%zu parameters, at most %d can be trained",
                        d->n_params, SDM_POD_MAX_PARAMS);
    sdm_status s = trainer_export_prepare(t, err);
    if (!s) s = sdm_train_ranges(c, t->shape, d->min, d->max, err);
    if (s) return s;
    d->shape = t->shape;
    d->grid = &c->grid;
    d->seed = c->seed;
    d->n_voxels = sdm_grid_count(&c->grid);
    // before the blocks: for a grid that is too large its message names the memory needed
    if ((s = trainer_dataset_create(d, c, err))) return s;

    // block edge 0 means map order: one block as large as the grid
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

static void fill_report(void *user, size_t done, size_t all)
{
    trainer *t = user;
    const size_t fixed = t->data.n_holdout + t->data.n_static;
    t->data.n_taken = done > fixed ? done - fixed : 0;
    trainer_report(t, trainer_start_fraction(t), (double)done / (trainer_seconds(t) + 1e-9),
                   done == all);
}

static bool fill_cancelled(void *user) { return trainer_cancelled(user); }

/* true when the computation of the data has used half of a time budget. */
static bool fill_enough(void *user) { return trainer_start_fraction(user) > 0.5; }

/* Refuses a grid without a voxel inside any held-out shape: a network trained on it would have a
 * small error but be useless. */
static sdm_status train_check_grid(const trainer *t, sdm_error *err)
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

/* Makes all maps needed before training. resumed: exactly as many as the interrupted run made, else
 * as many as the time budget allows. */
static sdm_status train_make_maps(trainer *t, bool resumed, sdm_error *err)
{
    const size_t start = t->data.n_start;
    const fill_hooks hooks = {.report = fill_report,
                              .cancelled = fill_cancelled,
                              .enough = resumed ? NULL : fill_enough,
                              .user = t};
    t->phase = SDM_PHASE_DATA;
    const sdm_status s = trainer_dataset_fill(&t->data, t->n_threads, &hooks, err);
    if (s) return s;
    if (t->data.n_start < start)
        trainer_message(t,
                        "half of the budget is over after %zu of %zu random maps: training starts "
                        "with these (lower "
                        "data.start or raise "
                        "train.minutes)",
                        t->data.n_start, start);
    return train_check_grid(t, err);
}

/* Prepares everything for the first step: maps, network, producer. A resumed run makes the n_taken
 * random samples of the checkpoint again. */
static sdm_status train_prepare(trainer *t, bool resumed, size_t n_taken, sdm_error *err)
{
    sdm_status s = train_make_maps(t, resumed, err);
    t->phase = SDM_PHASE_BASES;
    trainer_report(t, trainer_start_fraction(t), 0, true);
    if (!s) s = t->kind->begin(t, err);
    if (!s) s = trainer_samples_start(t, err);
    if (!s && resumed) s = trainer_samples_retake(t, n_taken, err);
    if (s == SDM_E_CANCELLED)
        s = sdm_fail(err, s, "stopped on request before the training began: %s is as it was",
                     t->folder);
    return s;
}

/* Runs all steps from set-up to trained weights. config: the open temporary file of config.yaml. It
   is committed, and the files of an older run are removed, only after all checks of the
   configuration: until then the folder stays as it was. */
static sdm_status train_run(trainer *t, bool resume, sdm_outfile **config, sdm_error *err)
{
    bool found = false;
    sdm_status s = train_set_up(t, err);
    if (!s && resume) {
        s = trainer_checkpoint_read(t, &found, err);
        if (!s && !found)
            trainer_message(t, "no checkpoint in %s: training starts from the beginning",
                            t->folder);
    }
    if (s) return s;
    const sdm_phase from = t->phase;
    const double resumed_seconds = trainer_seconds(t);
    s = train_prepare(t, found, t->data.n_taken, err);
    if (!s && !resume) s = trainer_checkpoint_clear_folder(t, err);
    if (!s) s = sdm_outfile_commit(config, err);
    if (s) return s;

    if (found) {
        // the time in which the maps were made again does not count
        t->started += trainer_seconds(t) - resumed_seconds;
        t->phase = from;
    } else {
        trainer_enter(t, SDM_PHASE_MODE_FIT);
    }
    t->last_checkpoint = trainer_seconds(t);
    return t->kind->run(t, found, err);
}

/* Measures and writes the model. If the model cannot be written, a checkpoint keeps the trained
 * weights. */
static sdm_status train_finish(trainer *t, sdm_train_report *report, sdm_error *err)
{
    const sdm_phase phase = t->phase;
    const size_t lines = t->metrics->size;
    t->phase = SDM_PHASE_EVALUATE;
    trainer_report(t, 1, 0, true);
    const sdm_status s = trainer_export_model(t, report, err);
    if (!s) return trainer_checkpoint_remove(t, err);
    t->phase = phase;
    t->metrics->size = lines;
    if (s != SDM_E_QUALITY && !trainer_checkpoint_write(t, NULL))
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
                 .kind = config->network.kind == SDM_NETWORK_POD ? &trainer_kind_pod
                                                                 : &trainer_kind_direct,
                 .started = sdm_clock(),
                 .loss = NAN,
                 .heldout_mse = NAN,
                 .metrics = &metrics};
    if (hooks) t.hooks = *hooks;
    t.n_threads = sdm_threads(config->threads);
    sdm_outfile *resolved = NULL;
    sdm_team *team = NULL;
    sdm_status s = sdm_make_folder(folder, err);
    if (!s) s = sdm_team_start(t.n_threads, &team, err);
    if (!s) s = trainer_export_config(&t, &resolved, err);
    if (!s) s = train_run(&t, resume, &resolved, err);
    sdm_outfile_discard(&resolved);
    trainer_producer_stop(t.producer);
    t.producer = NULL;
    if (!s) s = train_finish(&t, report, err);
    t.kind->dispose(&t);
    trainer_dataset_dispose(&t.data);
    sdm_free(t.blocks);
    sdm_text_dispose(&metrics);
    sdm_team_end(team);
    return s;
}
