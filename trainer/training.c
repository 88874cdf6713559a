/* The training of one kind of network from beginning to end: maps, network, training, model file.
 */
#include "training.h"

#include <math.h>
#include <stdio.h>

#include "data/dataset_fill.h"
#include "fine/fine_fit.h"
#include "other_model.h"
#include "sdm/internal/file.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "set_up.h"
#include "state/checkpoint.h"
#include "state/data_files.h"
#include "state/export_model.h"
#include "state/forecast.h"
#include "state/new_samples.h"
#include "state/progress.h"

/* true: the folder holds the model of the kind that was trained before. */
static bool is_second(const trainer *t) { return t->turns->at > 0; }

/* Tells once that the maps made in any case take longer than the budget. Of two trainings the
 * first may use time of the second. */
static void tell_forecast(trainer *t, size_t done)
{
    const dataset *d = &t->data;
    const size_t random = d->n_start < FILL_LEAST_RANDOM ? d->n_start : FILL_LEAST_RANDOM;
    double seconds;
    if (t->overrun_told || t->turns->n > 1 ||
        !trainer_forecast(t, t->phase_started, done, d->n_holdout + d->n_static + random, &seconds))
        return;
    t->overrun_told = true;
    trainer_message(t,
                    "the run will take longer than train.minutes (%.4g): the %zu held-out maps, "
                    "%zu of the static grid and %zu random ones are made in any case, which takes "
                    "about %.0f s (raise train.minutes to %.4g, or lower data.holdout or "
                    "data.static)",
                    t->config->train.minutes, d->n_holdout, d->n_static, random, seconds,
                    ceil(10 * 2 * seconds / 60) / 10);
}

/* Tells once how many maps fit into the budget, after the second that shows their pace. */
static void tell_pace(trainer *t, size_t done)
{
    enum { FEWEST = 8 };
    const double now = trainer_seconds(t), since = now - t->phase_started,
                 half = 0.5 * 60 * t->config->train.minutes;
    if (t->config->network.kind != SDM_NETWORK_POD || t->data.store || t->overrun_told ||
        t->pace_told || done < FEWEST || since < fmin(1, 0.1 * half))
        return;
    // held-out maps train nothing
    const double per_map = since / (double)done;
    trainer_tell_pace(t, t->config, per_map,
                      half - t->phase_started - per_map * (double)t->data.n_holdout);
}

static void fill_report(void *user, size_t done, size_t all)
{
    trainer *t = user;
    tell_forecast(t, done);
    tell_pace(t, done);
    t->pace.done = (int64_t)done;
    trainer_report(t, trainer_start_fraction(t), done == all);
}

static bool fill_cancelled(void *user) { return trainer_cancelled(user); }

/* true when the computation of the data has used half of a time budget. */
static bool fill_enough(void *user) { return trainer_start_fraction(user) > 0.5; }

/* Tells how many of the maps that the run may need come from files. Those of an error-driven plan
 * are not known before the training. */
static void tell_stored(const trainer *t)
{
    double p[SDM_POD_MAX_PARAMS];
    const dataset *d = &t->data;
    if (!d->store) return;
    const size_t n_random = d->n_start + (d->plan.by_error ? 0 : d->n_online),
                 n = d->n_holdout + d->n_static + n_random;
    size_t found = 0;
    for (size_t k = 0; k < d->n_holdout; k++) {
        trainer_dataset_holdout_params(d, k, p);
        found += sdm_map_store_has(d->store, p);
    }
    for (size_t k = 0; k < d->n_static; k++) {
        trainer_dataset_static_params(d, k, p);
        found += sdm_map_store_has(d->store, p);
    }
    for (size_t k = 0; k < n_random; k++) {
        trainer_dataset_random_params(d, k, p);
        found += sdm_map_store_has(d->store, p);
    }
    if (found < n)
        trainer_message(t, "%zu of %zu maps come from the dataset, the other %zu are made now",
                        found, n, n - found);
    else
        trainer_message(t, "all %zu maps come from the dataset", n);
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
    // the time of a resumed run does not count here
    t->overrun_told |= resumed;
    t->pace_told |= resumed;
    if (!resumed) t->phase_started = trainer_seconds(t);
    trainer_pace_start(t, 1);
    tell_stored(t);
    t->data.known = t->tried.n_voxels ? &t->tried : NULL;
    const double known = (double)(t->tried.n_holdout + t->tried.n_start),
                 began = trainer_seconds(t);
    const sdm_status s = trainer_dataset_fill(&t->data, t->n_threads, &hooks, err);
    const double made = (double)(t->data.n_holdout + t->data.n_static + t->data.n_start) - known;
    if (made > 0) t->map_seconds = (trainer_seconds(t) - began) / made;
    t->data.known = NULL;
    trainer_dataset_dispose(&t->tried);
    if (s) return s;
    const dataset *d = &t->data;
    if (d->n_start < start)
        trainer_message(t,
                        "half of the budget is over after %zu held-out maps, %zu of the static "
                        "grid and %zu of %zu random ones: training starts with these (lower %s or "
                        "raise train.minutes)",
                        d->n_holdout, d->n_static, d->n_start, start,
                        d->n_static > d->n_start    ? "data.static"
                        : d->n_holdout > d->n_start ? "data.holdout"
                                                    : "data.start");
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
    const double began = trainer_seconds(t);
    if (!s) s = t->kind->begin(t, err);
    t->begin_seconds = trainer_seconds(t) - began;
    if (!s) s = trainer_samples_start(t, err);
    if (!s && resumed) s = trainer_samples_retake(t, n_taken, err);
    if (s == SDM_E_CANCELLED && is_second(t))
        s = sdm_fail(err, s,
                     "stopped on request before the training of pod began: %s holds the model of "
                     "kind template",
                     t->folder);
    else if (s == SDM_E_CANCELLED)
        s = sdm_fail(err, s, "stopped on request before the training began: %s is as it was",
                     t->folder);
    return s;
}

/* Names the keys that were changed in vain: a template without a correction is not trained. Not
 * with network.kind: auto, where the keys are for the other kind. */
static void tell_vain_keys(trainer *t)
{
    sdm_text keys = {0};
    if (!t->data.only_holdout || t->turns->chosen) return;
    sdm_config_changed_keys(t->config, "network", " kind weights fine ", &keys);
    sdm_config_changed_keys(t->config, "data", " holdout memory_gb workers ", &keys);
    sdm_config_changed_keys(t->config, "train", " minutes steps samples near_mm clamp_mm ", &keys);
    if (keys.size && !keys.failed)
        trainer_message(t, "the template needs no training, so these keys have no effect: %s",
                        keys.data);
    sdm_text_dispose(&keys);
}

/* Does all that precedes the first step: set-up, checkpoint, maps. *found: the run goes on from a
 * checkpoint. The folder stays as it was. */
static sdm_status train_begin(trainer *t, bool resume, bool *found, sdm_error *err)
{
    sdm_status s = sdm_comm_agree(t->hooks.comm, trainer_set_up(t, err), err);
    if (!s) tell_vain_keys(t);
    if (!s && resume) {
        s = trainer_checkpoint_read(t, found, err);
        if (!s && !*found) trainer_tell_no_checkpoint(t);
    }
    if (s) return s;
    const sdm_phase from = t->phase;
    const double resumed_seconds = trainer_seconds(t);
    s = train_prepare(t, *found, t->data.n_taken, err);
    if (!*found) return s;
    // the time in which the maps were made again does not count
    t->started += trainer_seconds(t) - resumed_seconds;
    t->phase = from;
    return s;
}

/* Trains the weights. config: the open temporary file of config.yaml. It is committed, and the
   files of an older run are replaced, only now, after all checks of the configuration. The second
   training of a run leaves the files of the first alone. found: as train_begin() tells. */
static sdm_status train_run(trainer *t, bool resume, bool found, sdm_outfile **config,
                            sdm_error *err)
{
    sdm_status s = SDM_OK;
    if (!resume && !is_second(t)) s = trainer_checkpoint_clear_folder(t, err);
    const bool writes = !is_second(t) && trainer_writes(t);
    if (!s && writes) s = trainer_data_files_copy(t, err);
    if (!s && writes) s = sdm_outfile_commit(config, err);
    s = sdm_comm_agree(t->hooks.comm, s, err);
    if (!s && !is_second(t)) s = trainer_metric_ranks(t, err);
    if (s) return s;
    if (!found) trainer_enter(t, SDM_PHASE_MODE_FIT);
    t->last_checkpoint = t->prepared_seconds = trainer_shared_seconds(t);
    return t->kind->run(t, found, err);
}

/* Tells if the run took longer than its budget of time, and why. measured: seconds of the
 * measurement of the model. */
static void tell_overrun(trainer *t, double measured)
{
    // the first of two trainings may use the share of the second
    const double minutes = is_second(t) ? t->config->train.minutes : t->turns->budget,
                 budget = minutes * 60, over = trainer_seconds(t) - budget;
    if (!trainer_by_time(t) || over < fmax(1, 0.02 * budget)) return;
    trainer_message(
        t,
        "the run took %.0f s longer than train.minutes: the maps, bases and trials before "
        "the first step took %.0f s, the measurement of the model %.0f s (lower "
        "data.start, data.static or data.holdout, or raise train.minutes)",
        over, t->prepared_seconds, measured);
}

/* Writes the model, then a better one with a fine level if that is asked for. */
static sdm_status write_model(trainer *t, sdm_outfile **config, sdm_error *err)
{
    sdm_status s = trainer_export_model(t, err);
    if (!s && is_second(t)) s = sdm_outfile_commit(config, err);
    return s ? s : trainer_fine_add(t, err);
}

/* Measures the model, and writes it unless the one that the folder holds is better. If it cannot be
 * written, a checkpoint keeps the trained weights. */
static sdm_status train_finish(trainer *t, sdm_outfile **config, sdm_train_report *report,
                               sdm_error *err)
{
    const sdm_phase phase = t->phase;
    const double started = trainer_seconds(t);
    const size_t lines = t->metrics->size;
    t->phase = SDM_PHASE_EVALUATE;
    trainer_report(t, 1, true);
    sdm_status s = trainer_export_judge(t, report, err);
    const bool wins = !s && (!is_second(t) || trainer_second_wins(t->turns, report));
    if (!s && trainer_writes(t) && is_second(t)) trainer_other_model_keep(t, wins, report);
    if (wins && trainer_writes(t)) s = write_model(t, config, err);
    report->seconds = trainer_shared_seconds(t);
    s = sdm_comm_agree(t->hooks.comm, s, err);
    if (!s) {
        tell_overrun(t, report->seconds - started);
        return trainer_checkpoint_remove(t, err);
    }
    t->phase = phase;
    t->metrics->size = lines;
    if (s != SDM_E_QUALITY && !trainer_checkpoint_write(t, NULL) && err) {
        const sdm_error why = *err;
        sdm_fail(err, s, "%s; a checkpoint is in %s: go on with --resume", why.text, t->folder);
    }
    return s;
}

sdm_status trainer_training(trainer *t, bool resume, bool *unfit, sdm_train_report *report,
                            sdm_error *err)
{
    sdm_outfile *config = NULL;
    bool found = false;
    *unfit = false;
    t->kind = trainer_kind_find(t->config->network.kind);
    sdm_status s = trainer_writes(t) ? trainer_export_config(t, &config, err) : SDM_OK;
    s = sdm_comm_agree(t->hooks.comm, s, err);
    if (!s) {
        s = train_begin(t, resume, &found, err);
        *unfit = s && s != SDM_E_CANCELLED && !resume && !sdm_comm_broken(t->hooks.comm);
    }
    if (!s) s = train_run(t, resume, found, &config, err);
    trainer_producer_stop(t->producer);
    t->producer = NULL;
    if (!s) s = train_finish(t, &config, report, err);
    if (s == SDM_E_QUALITY) *unfit = true;
    sdm_outfile_discard(&config);
    t->kind->dispose(t);
    trainer_dataset_dispose(&t->data);
    trainer_dataset_dispose(&t->tried);
    sdm_free(t->blocks);
    return s;
}
