/* A training run from beginning to end: maps, network, training, model file. */
#include <math.h>
#include <stdio.h>

#include "data/dataset_fill.h"
#include "fine/fine_fit.h"
#include "race.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/team.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "set_up.h"
#include "state/checkpoint.h"
#include "state/export_model.h"
#include "state/kind.h"
#include "state/new_samples.h"
#include "state/progress.h"

static void fill_report(void *user, size_t done, size_t all)
{
    trainer *t = user;
    t->pace.done = (int64_t)done;
    trainer_report(t, trainer_start_fraction(t), done == all);
}

static bool fill_cancelled(void *user) { return trainer_cancelled(user); }

/* true when the computation of the data has used half of a time budget. */
static bool fill_enough(void *user) { return trainer_start_fraction(user) > 0.5; }

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
    trainer_pace_start(t, 1);
    t->data.known = t->tried.n_voxels ? &t->tried : NULL;
    const sdm_status s = trainer_dataset_fill(&t->data, t->n_threads, &hooks, err);
    t->data.known = NULL;
    trainer_dataset_dispose(&t->tried);
    if (s) return s;
    if (t->data.n_start < start)
        trainer_message(t,
                        "half of the budget is over after %zu of %zu random maps: training starts "
                        "with these (lower "
                        "data.start or raise "
                        "train.minutes)",
                        t->data.n_start, start);
    return trainer_check_grid(t, err);
}

/* Prepares everything for the first step: maps, network, producer. A resumed run makes the n_taken
 * random samples of the checkpoint again. */
static sdm_status train_prepare(trainer *t, bool resumed, size_t n_taken, sdm_error *err)
{
    sdm_status s = train_make_maps(t, resumed, err);
    t->phase = SDM_PHASE_BASES;
    trainer_pace_start(t, 0);
    trainer_report(t, trainer_start_fraction(t), true);
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
    sdm_status s = trainer_set_up(t, err);
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
    t->last_checkpoint = t->prepared_seconds = trainer_seconds(t);
    return t->kind->run(t, found, err);
}

/* Tells if the run took longer than its budget of time, and why. measured: seconds of the
 * measurement of the model. */
static void tell_overrun(trainer *t, double measured)
{
    const double budget = t->config->train.minutes * 60, over = trainer_seconds(t) - budget;
    if (!trainer_by_time(t) || over < fmax(1, 0.02 * budget)) return;
    trainer_message(
        t,
        "the run took %.0f s longer than train.minutes: the maps, bases and trials before "
        "the first step took %.0f s, the measurement of the model %.0f s (lower "
        "data.start, data.static or data.holdout, or raise train.minutes)",
        over, t->prepared_seconds, measured);
}

/* A template is ready as soon as its meshes are measured. Says so if `auto` has chosen it and most
 * of the time is left. */
static void tell_unused(trainer *t, const sdm_config *asked)
{
    const double left = t->config->train.minutes * 60 - trainer_seconds(t);
    if (asked->network.kind != SDM_NETWORK_AUTO || !trainer_by_time(t) ||
        t->config->network.kind != SDM_NETWORK_TEMPLATE ||
        left < 0.5 * t->config->train.minutes * 60)
        return;
    trainer_message(t,
                    "auto: %.0f s of train.minutes were not needed; network.kind=pod trains with "
                    "all of them, and may reach a smaller error inside parts that overlap and far "
                    "from the surface",
                    left);
}

/* Measures and writes the model. If the model cannot be written, a checkpoint keeps the trained
 * weights. */
static sdm_status train_finish(trainer *t, sdm_train_report *report, sdm_error *err)
{
    const sdm_phase phase = t->phase;
    const double started = trainer_seconds(t);
    const size_t lines = t->metrics->size;
    t->phase = SDM_PHASE_EVALUATE;
    trainer_report(t, 1, true);
    sdm_status s = trainer_export_model(t, report, err);
    if (!s) s = trainer_fine_add(t, err);
    if (!s) {
        if (report) report->seconds = trainer_seconds(t);
        tell_overrun(t, trainer_seconds(t) - started);
        return trainer_checkpoint_remove(t, err);
    }
    t->phase = phase;
    t->metrics->size = lines;
    if (s != SDM_E_QUALITY && !trainer_checkpoint_write(t, NULL))
        trainer_message(t, "a checkpoint is in %s: go on with --resume", t->folder);
    return s;
}

/* *c = the configuration of the run: `config`, where network.kind: auto is settled by a race, or on
 * resuming by config.yaml of the interrupted run. */
static sdm_status train_settle(trainer *t, const sdm_config *config, bool resume, sdm_config *c,
                               sdm_error *err)
{
    *c = *config;
    if (config->network.kind != SDM_NETWORK_AUTO) return SDM_OK;
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/config.yaml", t->folder);
    sdm_config *before = NULL;
    sdm_status s = SDM_ALLOC(&before, 1, "configuration", err);
    if (s) return s;
    const bool found = resume && !sdm_config_read(path, NULL, 0, before, NULL);
    if (found) sdm_config_choose_kind(c, before->network.kind);
    sdm_free(before);
    return found ? SDM_OK : trainer_race(t, c, err);
}

sdm_status sdm_train(const sdm_config *config, const sdm_instance *shape, const char *folder,
                     bool resume, const sdm_train_hooks *hooks, sdm_train_report *report,
                     sdm_error *err)
{
    sdm_text metrics = {0};
    trainer t = {.config = config,
                 .shape = shape,
                 .folder = folder,
                 .started = sdm_clock(),
                 .loss = NAN,
                 .heldout_mse = NAN,
                 .evaluated_step = -1,
                 .metrics = &metrics};
    if (hooks) t.hooks = *hooks;
    t.n_threads = sdm_threads(config->threads);
    sdm_outfile *resolved = NULL;
    sdm_config *settled = NULL;
    sdm_team *team = NULL;
    const size_t existing = sdm_folder_existing(folder);
    sdm_status s = sdm_make_folder(folder, err);
    if (!s) s = SDM_ALLOC(&settled, 1, "configuration", err);
    if (!s) s = sdm_team_start(t.n_threads, &team, err);
    if (!s) s = train_settle(&t, config, resume, settled, err);
    if (s) {
        trainer_dataset_dispose(&t.tried);
        sdm_team_end(team);
        sdm_free(settled);
        sdm_text_dispose(&metrics);
        sdm_folder_remove_empty(folder, existing);
        return s;
    }
    t.config = settled;
    t.kind = trainer_kind_find(settled->network.kind);
    s = trainer_export_config(&t, &resolved, err);
    if (!s) s = train_run(&t, resume, &resolved, err);
    sdm_outfile_discard(&resolved);
    trainer_producer_stop(t.producer);
    t.producer = NULL;
    if (!s) s = train_finish(&t, report, err);
    if (!s) tell_unused(&t, config);
    if (s) sdm_folder_remove_empty(folder, existing);
    t.kind->dispose(&t);
    trainer_dataset_dispose(&t.data);
    trainer_dataset_dispose(&t.tried);
    sdm_free(t.blocks);
    sdm_text_dispose(&metrics);
    sdm_team_end(team);
    sdm_free(settled);
    return s;
}
