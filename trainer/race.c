/* Short trials of kinds of networks. */
#include "race.h"

#include <math.h>
#include <stdio.h>

#include "data/dataset_fill.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "set_up.h"
#include "state/export_model.h"
#include "state/forecast.h"
#include "state/progress.h"

enum { HOLDOUT = 32, MAPS = 384, MAPS_MAX = 1024 };

/* With an error of this part of a voxel no other kind is tried. */
static const double ENOUGH = 1.0 / 500;

/* Training improves the score of `pod` over that of its trial by a factor of at most 11 in all
   families measured (docs/notes/network.md): where its trial is worse than the template by more
   than this, it is not trained. */
static const double HOPELESS = 15;

/* The trial of `pod` takes up to about twice as long as that of the template, for its bases. It is
   left out where both would take more than this part of a budget of time. */
static const double POD_TRIAL = 2, TRIALS_MOST = 1.0 / 3;

/* On a busy machine the few maps of a trial are made faster than the many of a training (measured:
   by a factor of 1.2 to 2). */
static const double BURST = 1.5;

/* Part of the budget for a template that is trained before `pod`. */
static const double TEMPLATE_SHARE = 1.0 / 3;

/* A kind of network in the race. */
typedef struct entrant {
    sdm_network_kind kind;
    trainer *race;       /* the run, with the whole budget */
    bool finished;       /* false: the shape does not allow this kind */
    bool ready;          /* it needs no training */
    bool cut;            /* the budget of time ended before all maps of the trial were made */
    turn_figures errors; /* of its trial */
    double filling;      /* s, when its maps were begun, of the run */
    double per_map;      /* s a map */
    double seconds;
    char left_out[SDM_ERROR_TEXT_MAX]; /* why the shape does not allow it; "": it does */
    trainer run;                       /* its trial; run.kind is NULL without one */
} entrant;

static void entrant_dispose(entrant *e)
{
    if (!e->run.kind) return;
    e->run.kind->dispose(&e->run);
    trainer_dataset_dispose(&e->run.data);
    sdm_free(e->run.blocks);
    e->run.blocks = NULL;
    e->run.kind = NULL;
}

size_t trainer_trial_maps(const sdm_config *c, size_t n_params)
{
    // four maps determine a polynomial; of degree 2 where that is within bounds
    size_t maps = 4 * sdm_poly_count(n_params, 2) + 4;
    maps = maps < MAPS ? MAPS : maps > MAPS_MAX ? MAPS_MAX : maps;
    size_t all = (size_t)c->data.start;
    size_t grid = sdm_config_static_count(c, n_params, 0) > 0;
    for (size_t i = 0; i < n_params && grid && grid < MAPS_MAX; i++)
        grid *= (size_t)sdm_config_static_count(c, n_params, i);
    all += grid < MAPS_MAX ? grid : MAPS_MAX;
    return all < maps ? (all ? all : 1) : maps;
}

int64_t trainer_trial_holdout(const sdm_config *c)
{
    return c->data.holdout < HOLDOUT ? c->data.holdout : HOLDOUT;
}

/* The configuration of a trial: a few maps, no optimiser steps. */
static void trial_config(const sdm_config *from, size_t n_params, sdm_network_kind kind,
                         sdm_config *c)
{
    *c = *from;
    sdm_config_choose_kind(c, kind);
    c->data.start = (int64_t)trainer_trial_maps(from, n_params);
    c->data.n_static_counts = 0;
    c->data.online = 0;
    c->data.sampling = SDM_SAMPLING_UNIFORM;
    c->data.holdout = trainer_trial_holdout(from);
    c->network.depth = 0;
    c->network.modes = c->network.modes < 256 ? c->network.modes : 256;
    c->train.refine = 0;
    c->train.minutes = 0, c->train.samples = 0, c->train.steps = 1;
}

static bool trial_cancelled(void *user) { return trainer_cancelled(((entrant *)user)->race); }

/* true when the trials have used their part of a time budget. */
static bool trial_enough(void *user)
{
    return trainer_start_fraction(((entrant *)user)->race) > TRAINER_TRIALS_SHARE;
}

/* Tells once that the maps which a trial makes in any case take longer than the budget. */
static void trial_report(void *user, size_t done, size_t all)
{
    entrant *e = user;
    trainer *t = e->race;
    const dataset *d = &e->run.data;
    const size_t random = d->n_start < FILL_LEAST_RANDOM ? d->n_start : FILL_LEAST_RANDOM;
    double seconds;
    (void)all;
    trainer_report(t, trainer_start_fraction(t), false);
    if (t->overrun_told || !trainer_forecast(t, e->filling, done, d->n_holdout + random, &seconds))
        return;
    t->overrun_told = true;
    trainer_message(t,
                    "the run will take longer than train.minutes (%.4g): a trial of "
                    "network.kind: auto makes at least %zu maps, which takes about %.0f s (raise "
                    "train.minutes, or give network.kind)",
                    t->config->train.minutes, d->n_holdout + random, seconds);
}

/* *out = the errors of a trial, and the time of a map. */
static sdm_status measure(const trainer *r, turn_figures *out, sdm_error *err)
{
    sdm_accuracy accuracy = {0};
    double rmse_voxel_mm = 0, map_ms = NAN;
    const sdm_status s = trainer_export_measure(r, &accuracy, &rmse_voxel_mm, &map_ms, err);
    *out = (turn_figures){r->config->network.kind, accuracy.rmse_mm, rmse_voxel_mm, map_ms};
    return s;
}

/* Trains and measures one entrant. Keeps its design and its maps. */
static sdm_status trial(trainer *t, const sdm_config *config, entrant *e, sdm_error *err)
{
    sdm_text metrics = {0};
    trainer *r = &e->run;
    *r = (trainer){.config = config,
                   .shape = t->shape,
                   .kind = trainer_kind_find(e->kind),
                   .hooks = {.cancelled = t->hooks.cancelled,
                             .store = t->hooks.store,
                             .comm = t->hooks.comm,
                             .user = t->hooks.user},
                   .n_threads = t->n_threads,
                   .started = sdm_clock(),
                   .loss = NAN,
                   .heldout_mse = NAN,
                   .evaluated_step = -1,
                   .metrics = &metrics};
    const fill_hooks hooks = {
        .report = trial_report, .cancelled = trial_cancelled, .enough = trial_enough, .user = e};
    sdm_error reason = {0};
    sdm_status s = trainer_set_up(r, &reason);
    if (s == SDM_E_UNSUPPORTED && e->kind != SDM_NETWORK_POD) {
        snprintf(e->left_out, sizeof e->left_out, "%s", reason.text);
        trainer_message(t, "auto: %s is left out: %s", trainer_turn_name(e->kind), reason.text);
        s = SDM_OK;
    } else {
        if (s && err) *err = reason;
        e->filling = trainer_shared_seconds(t);
        if (!s) s = trainer_dataset_fill(&r->data, r->n_threads, &hooks, err);
        e->per_map = (trainer_shared_seconds(t) - e->filling) /
                     fmax(1, (double)(r->data.n_holdout + r->data.n_start));
        if (!s) s = trainer_check_grid(r, err);
        if (!s) s = r->kind->begin(r, err);
        if (!s) {
            trainer_enter(r, SDM_PHASE_MODE_FIT);
            s = r->kind->run(r, false, err);
        }
        if (!s) s = measure(r, &e->errors, err);
        e->finished = !s;
    }
    e->seconds = trainer_seconds(r);
    e->ready = r->data.only_holdout;
    e->cut = !e->ready && (int64_t)r->data.n_start < config->data.start;
    r->metrics = NULL;
    sdm_text_dispose(&metrics);
    return s;
}

/* Runs the trial of an entrant and tells its result. */
static sdm_status try_kind(trainer *t, sdm_config *config, entrant *e, sdm_error *err)
{
    size_t n_params;
    sdm_instance_params(t->shape, &n_params);
    trial_config(t->config, n_params, e->kind, config);
    trainer_report(t, trainer_start_fraction(t), true);
    const sdm_status s = trial(t, config, e, err);
    if (!s && e->finished)
        trainer_message(t,
                        "auto: %s leaves %.2g mm within a voxel of the surface, %.2g mm everywhere "
                        "(trial on %lld maps, %.0f s)",
                        trainer_turn_name(e->kind), e->errors.rmse_voxel_mm, e->errors.rmse_mm,
                        e->ready ? (long long)config->data.start : (long long)e->run.data.n_start,
                        e->seconds);
    return s;
}

/* Before the trial of pod, with a budget of time: tells how many maps fit into it. Returns the
 * minutes that hold those which the parameters ask for, 0: the budget does. *no_time: it is too
 * short for the trial. */
static double tell_pace(trainer *t, sdm_config *scratch, const entrant *carried, bool *no_time)
{
    const double budget = 60 * t->config->train.minutes, now = trainer_shared_seconds(t);
    if (!trainer_by_time(t)) return 0;
    *no_time = (1 + POD_TRIAL) * now > TRIALS_MOST * budget;
    *scratch = *t->config;
    sdm_config_choose_kind(scratch, SDM_NETWORK_POD);
    // a template that is ready is measured in about the time of its trial
    const double first = carried->ready ? now : (budget - now) * TEMPLATE_SHARE,
                 trial = *no_time ? 0 : POD_TRIAL * now;
    return trainer_tell_pace(t, scratch, BURST * carried->per_map,
                             0.5 * (budget - now - trial - first));
}

/* true: at the pace of its trial, the training of a template that finished it leaves hardly any of
 * a budget of time for another kind. */
static bool leaves_little(const trainer *t, const entrant *e)
{
    const dataset *d = &e->run.data;
    const double budget = 60 * t->config->train.minutes, now = trainer_shared_seconds(t),
                 share = e->ready ? 0 : TEMPLATE_SHARE * fmax(0, budget - now),
                 made = (double)(d->n_holdout + d->n_start),
                 missing = (double)t->config->data.holdout - (double)d->n_holdout,
                 // held-out maps and the end of a training take their time whatever its share is
        needed = e->per_map * missing + fmax(0, e->seconds - e->per_map * made);
    return trainer_by_time(t) && now + fmax(share, needed) > (1 - TRAINER_ENOUGH_LEFT) * budget;
}

/* Decides which kinds are trained; returns the reason. no_time: the budget is too short for a trial
 * of pod. little: hardly any of it will be left for the training of pod. */
static const char *decide(const entrant *carried, const entrant *pod, bool no_time, bool little,
                          training_turns *out)
{
    *out = (training_turns){.n = 1, .kind = {SDM_NETWORK_TEMPLATE}, .chosen = true, .share = 1};
    if (!carried->finished) {
        out->kind[0] = SDM_NETWORK_POD;
        return "the only kind left";
    }
    if (!pod->finished && !no_time) return "hardly any error is left";
    const double ratio =
        no_time ? INFINITY : trainer_score(&pod->errors) / trainer_score(&carried->errors);
    // a trial with fewer maps than planned, or none, rules nothing out
    if (ratio > HOPELESS && !pod->cut && !no_time)
        return "training does not make up for such a difference";
    if (ratio <= 1) {
        out->kind[0] = SDM_NETWORK_POD;
        return "its error (at the surface, and a tenth of that everywhere) is the smaller one, and "
               "training improves pod more than template";
    }
    out->n = 2, out->kind[1] = SDM_NETWORK_POD;
    out->share = carried->ready ? 1 : TEMPLATE_SHARE;
    if (little)
        return "at the measured pace its training leaves hardly any of the budget for pod; more "
               "train.minutes compare both";
    if (no_time)
        return carried->ready
                   ? "ready, then pod is trained, without a trial, for which "
                     "train.minutes is short, and the better one is kept"
                   : "trained with a third of the budget, then pod, without a trial, for "
                     "which train.minutes is short, and the better one is kept";
    return carried->ready
               ? "ready, then pod is trained, and the better one is kept"
               : "trained with a third of the budget, then pod, and the better one is kept";
}

/* Hands the design and the maps of the entrant on to the training. */
static void hand_on(entrant *e, trial_gain *gain)
{
    *gain = (trial_gain){e->run.design, e->run.data};
    e->run.design = NULL;
    e->run.data = (dataset){0};
}

sdm_status trainer_race(trainer *t, sdm_config *scratch, training_turns *out, trial_gain gain[2],
                        sdm_error *err)
{
    entrant e[] = {{.kind = SDM_NETWORK_TEMPLATE, .race = t}, {.kind = SDM_NETWORK_POD, .race = t}};
    turn_figures figures[2];
    size_t n = 0;
    t->phase = SDM_PHASE_TRIAL;
    sdm_status s = try_kind(t, scratch, &e[0], err);
    const bool done =
        e[0].finished && trainer_score(&e[0].errors) < ENOUGH * t->config->grid.spacing[0];
    bool no_time = false;
    double pod_minutes = 0;
    if (!s && e[0].finished && !done) {
        pod_minutes = tell_pace(t, scratch, &e[0], &no_time);
        if (!no_time) s = try_kind(t, scratch, &e[1], err);
    }
    if (!s) {
        const char *reason =
            decide(&e[0], &e[1], no_time, e[0].finished && leaves_little(t, &e[0]), out);
        out->pod_minutes = pod_minutes;
        const entrant *other = out->kind[0] == e[0].kind ? &e[1] : &e[0];
        out->tried_other = other->finished;
        if (out->tried_other) out->other = other->errors;
        trainer_message(t, "auto: network.kind is %s: %s", trainer_turn_name(out->kind[0]), reason);
        for (size_t i = 0; i < 2; i++)
            if (e[i].finished) figures[n++] = e[i].errors;
        char why[2 * SDM_ERROR_TEXT_MAX];
        snprintf(why, sizeof why, "%s%s%s", reason,
                 e[0].left_out[0] ? ": template is left out: " : "", e[0].left_out);
        s = trainer_turns_record(t->metrics, out->kind[0], out->n > 1 ? &out->kind[1] : NULL, why,
                                 figures, n, err);
    }
    for (int i = 0; i < out->n && !s; i++) {
        entrant *winner = out->kind[i] == e[0].kind ? &e[0] : &e[1];
        if (winner->finished) hand_on(winner, &gain[i]);
    }
    for (size_t i = 0; i < 2; i++) entrant_dispose(&e[i]);
    t->phase = SDM_PHASE_DATA;
    return s;
}
