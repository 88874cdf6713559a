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

/* Where there is no time for trials, a shape that bends and has at most so many parameters is
   trained as `pod`. In the families measured the trained `pod` was as good as a template with a
   correction, or better, with up to 5 parameters, and much worse with 20 (docs/notes/network.md).
 */
static const size_t FEW_PARAMS = 8;

/* A template whose score is this part of a voxel is poor: without a trial, `pod` is trained. */
static const double POOR = 0.2;

/* Where one of two kinds is to be chosen: training improves the score of `pod` by a factor of 3 in
   the middle of the families measured. */
static const double POD_GAIN = 3;

/* Part of a budget of time that a second training has at least. */
static const double SECOND_SHARE = 2.0 / 3;

/* The measurement of a model takes about as long as so many exact maps. */
static const double MEASUREMENT = 100;

/* On a busy machine the few maps of a trial are made faster than the many of a training (measured:
   by a factor of 1.2 to 2). */
static const double BURST = 1.5;

/* The next run may make maps more slowly than this one by this factor, as on a busier machine. */
static const double PACE_MARGIN = 1.6;

/* Where there is no time for trials, a template that needs no correction is made before `pod` if
   that is expected to take at most this part of the budget. */
static const double TEMPLATE_FIRST = 0.5;

/* The design of a template of several parts takes at most as long as so many exact maps
   (docs/notes/network.md). */
static const double DESIGN_PARTS = 400;

/* Part of a budget of steps for a template that is trained before `pod`. */
static const double TEMPLATE_SHARE = 1.0 / 3;

/* A kind of network in the race. */
typedef struct entrant {
    sdm_network_kind kind;
    trainer *race;       /* the run, with the whole budget */
    bool finished;       /* false: the shape does not allow this kind */
    bool ready;          /* it needs no training */
    bool only_ready;     /* the kind is wanted only if it needs no training: it leaves the race
                            before its trial if it needs some, or if its design takes too long */
    const char *dropped; /* why; NULL: it was not */
    bool late;           /* because its design takes too long */
    bool cut;            /* the budget of time ended before all maps of the trial were made */
    turn_figures errors; /* of its trial */
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

static void trial_report(void *user, size_t done, size_t all)
{
    trainer *t = ((entrant *)user)->race;
    (void)done, (void)all;
    trainer_report(t, trainer_start_fraction(t), false);
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

/* Prepares the trial of one kind of network. *allowed = false: the shape does not allow this kind,
 * or the kind is given up (entrant.dropped says why); the trial then makes no maps. */
static sdm_status set_up(trainer *t, entrant *e, bool *allowed, sdm_error *err)
{
    sdm_error reason = {0};
    trainer *r = &e->run;
    if (e->only_ready)
        r->design_until = t->started + TEMPLATE_FIRST * 60 * t->config->train.minutes;
    sdm_status s = trainer_set_up(r, &reason);
    // the ranks have clocks of their own
    if (e->only_ready) s = sdm_comm_agree(t->hooks.comm, s, &reason);
    e->ready = !s && r->data.only_holdout;
    const char *dropped = !e->only_ready         ? NULL
                          : s == SDM_E_CANCELLED ? "its design takes over half of train.minutes"
                          : !s && !e->ready      ? "it needs training, too"
                                                 : NULL;
    *allowed = !s && !dropped;
    if (*allowed) return s;
    if (!dropped && (s != SDM_E_UNSUPPORTED || e->kind == SDM_NETWORK_POD)) {
        if (err) *err = reason;
        return s;
    }
    e->dropped = dropped;
    e->late = e->only_ready && s == SDM_E_CANCELLED;
    if (!dropped) snprintf(e->left_out, sizeof e->left_out, "%s", reason.text);
    trainer_message(t, "auto: %s is left out: %s", trainer_turn_name(e->kind),
                    dropped ? dropped : reason.text);
    return SDM_OK;
}

/* Trains and measures one entrant. Keeps its design and its maps. known: exact maps made
 * before. */
static sdm_status trial(trainer *t, const sdm_config *config, const dataset *known, entrant *e,
                        sdm_error *err)
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
    bool allowed = false;
    sdm_status s = set_up(t, e, &allowed, err);
    if (!s && allowed) {
        if (known->n_voxels && !r->data.target.make) r->data.known = known;
        s = trainer_dataset_fill(&r->data, r->n_threads, &hooks, err);
        r->data.known = NULL;
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
    e->cut = !e->ready && (int64_t)r->data.n_start < config->data.start;
    r->metrics = NULL;
    sdm_text_dispose(&metrics);
    return s;
}

/* Runs the trial of an entrant and tells its result. */
static sdm_status try_kind(trainer *t, sdm_config *config, const dataset *known, entrant *e,
                           sdm_error *err)
{
    size_t n_params;
    sdm_instance_params(t->shape, &n_params);
    trial_config(t->config, n_params, e->kind, config);
    trainer_report(t, trainer_start_fraction(t), true);
    const sdm_status s = trial(t, config, known, e, err);
    if (!s && e->finished)
        trainer_message(t,
                        "auto: %s leaves %.2g mm within a voxel of the surface, %.2g mm everywhere "
                        "(trial on %lld maps, %.0f s)",
                        trainer_turn_name(e->kind), e->errors.rmse_voxel_mm, e->errors.rmse_mm,
                        e->ready ? (long long)config->data.start : (long long)e->run.data.n_start,
                        e->seconds);
    return s;
}

/* train.minutes of which TRAINER_TRIALS_SHARE holds the trials of both kinds, with a margin. */
static double trial_minutes(const trial_look *l)
{
    return ceil(10 * PACE_MARGIN * l->trials / (60 * TRAINER_TRIALS_SHARE)) / 10;
}

/* What is done where there is no time for the trials of both kinds. */
typedef enum haste {
    HASTE_NONE,  /* there is time */
    HASTE_POD,   /* pod is taken without a trial: a template is not likely to be kept */
    HASTE_FIRST, /* a template is made, and kept if it is good, as long as it needs no training */
    HASTE_TEMPLATE, /* a template alone has a trial, the beginning of its training */
} haste;

/* About the seconds until a template of several parts is made and measured. */
static double template_seconds(const trainer *t, const trial_look *l)
{
    return l->per_map * (DESIGN_PARTS + (double)t->config->data.holdout + MEASUREMENT);
}

/* About the seconds of a training of the template alone; 0: it was tried, it needs training, or the
 * shape may not allow it. */
static double untried_template_seconds(const trainer *t, const trial_look *l, const entrant *e)
{
    if (!l->divides || (e->run.kind && !e->late)) return 0;
    // more than half of the design was not done
    return fmax(template_seconds(t, l), e->late ? 2 * e->seconds : 0);
}

static haste haste_of(const trainer *t, const trial_look *l)
{
    size_t n_params;
    sdm_instance_params(t->shape, &n_params);
    if (!l->lacks_time) return HASTE_NONE;
    if (!l->bends || n_params > FEW_PARAMS) return HASTE_TEMPLATE;
    const double most = TEMPLATE_FIRST * 60 * t->config->train.minutes;
    return l->divides && template_seconds(t, l) <= most ? HASTE_FIRST : HASTE_POD;
}

/* Tells that there is no time for the trials of both kinds, and what is done instead. */
static void tell_haste(const trainer *t, const trial_look *l)
{
    char first[120];
    const haste h = haste_of(t, l);
    if (h == HASTE_NONE) return;
    snprintf(first, sizeof first,
             "template is made first, which takes about %.3g s, and kept if it is good",
             template_seconds(t, l));
    const char *done = h == HASTE_FIRST ? first
                       : h == HASTE_POD ? "pod is taken without trials"
                                        : "template alone has one";
    trainer_message(t,
                    "auto: trials of both kinds would take about %.3g s, and a fifth of "
                    "train.minutes is %.3g s: %s (for both raise train.minutes to %.4g)",
                    l->trials, TRAINER_TRIALS_SHARE * 60 * t->config->train.minutes, done,
                    trial_minutes(l));
}

/* With a budget of time: looks at the shape, and tells how many maps fit into the budget. *minutes
 * = those that hold the maps which the parameters ask for, 0: the budget does. */
static sdm_status look(trainer *t, sdm_config *scratch, trial_look *l, double *minutes,
                       sdm_error *err)
{
    const double budget = 60 * t->config->train.minutes;
    size_t n_params;
    if (!trainer_by_time(t)) return SDM_OK;
    sdm_instance_params(t->shape, &n_params);
    trial_config(t->config, n_params, SDM_NETWORK_POD, scratch);
    trainer_report(t, trainer_start_fraction(t), true);
    const sdm_status s = trainer_look(t, scratch, l, err);
    if (s) return s;
    const double spent = trainer_shared_seconds(t) + (l->lacks_time ? 0 : l->trials);
    *scratch = *t->config;
    sdm_config_choose_kind(scratch, SDM_NETWORK_POD);
    *minutes = trainer_tell_pace(t, scratch, BURST * l->per_map, 0.5 * budget - spent);
    tell_haste(t, l);
    return SDM_OK;
}

/* true: the budget of time holds the maps of a template and its measurement, and leaves enough of
 * it for a training of pod. */
static bool holds_both(const trainer *t, const trial_look *l, const entrant *carried)
{
    const dataset *d = &carried->run.data;
    double maps = (double)t->config->data.holdout + MEASUREMENT;
    double grid = 1;
    if (!trainer_by_time(t)) return true;
    for (size_t i = 0; i < d->n_params; i++)
        grid *= (double)sdm_config_static_count(t->config, d->n_params, i);
    if (!carried->ready) maps += grid + FILL_LEAST_RANDOM;
    return trainer_shared_seconds(t) + BURST * l->per_map * maps <
           (1 - SECOND_SHARE) * 60 * t->config->train.minutes;
}

/* Part of the budget left by the trials for a template before pod. */
static double first_share(const trainer *t, bool ready)
{
    const double budget = 60 * t->config->train.minutes;
    if (ready) return 1;
    if (!trainer_by_time(t)) return TEMPLATE_SHARE;
    return 1 - SECOND_SHARE * budget / (budget - trainer_shared_seconds(t));
}

/* Decides without a trial of pod, for which the budget is too short. */
static const char *decide_untried(const trainer *t, const entrant *carried, training_turns *out)
{
    if (!carried->run.kind || carried->dropped) {
        out->kind[0] = SDM_NETWORK_POD;
        return "it suits a shape of few parameters that bends or stretches";
    }
    if (trainer_score(&carried->errors) > POOR * t->config->grid.spacing[0]) {
        out->kind[0] = SDM_NETWORK_POD;
        return "the trial of template leaves a large error";
    }
    if (carried->only_ready) {
        out->n = 2, out->kind[1] = SDM_NETWORK_POD, out->if_good = true;
        return "it is ready, and kept if it is good; else pod gets the rest of the "
               "budget, and the better one is kept";
    }
    out->untried = true;
    return "it suits parts that only move, and shapes of many parameters";
}

/* Decides which kinds are trained; returns the reason. */
static const char *decide(const trainer *t, const trial_look *l, const entrant *carried,
                          const entrant *pod, bool done, training_turns *out)
{
    *out = (training_turns){.n = 1, .kind = {SDM_NETWORK_TEMPLATE}, .chosen = true, .share = 1};
    if (carried->left_out[0]) {
        out->kind[0] = SDM_NETWORK_POD;
        return "the only kind left";
    }
    if (done) return "hardly any error is left";
    if (!pod->finished) return decide_untried(t, carried, out);
    const double ratio = trainer_score(&pod->errors) / trainer_score(&carried->errors);
    // a trial with fewer maps than planned rules nothing out
    if (ratio > HOPELESS && !pod->cut) return "training does not make up for such a difference";
    if (ratio <= 1) {
        out->kind[0] = SDM_NETWORK_POD;
        return "its error (at the surface, and a tenth of that everywhere) is the smaller one, and "
               "training improves pod more than template";
    }
    if (!holds_both(t, l, carried)) {
        if (ratio > POD_GAIN)
            return "train.minutes holds one training, which would not make pod the better kind";
        out->kind[0] = SDM_NETWORK_POD;
        return "train.minutes holds one training, which improves pod more than template";
    }
    out->n = 2, out->kind[1] = SDM_NETWORK_POD;
    out->share = first_share(t, carried->ready);
    return carried->ready ? "it is ready, then pod is trained, and the better one is kept"
                          : "it is trained with at most a third of the budget, then pod with the "
                            "rest, and the better one is kept";
}

/* Hands the design and the maps of the entrant on to the training. */
static void hand_on(entrant *e, trial_gain *gain)
{
    *gain = (trial_gain){e->run.design, e->run.data};
    e->run.design = NULL;
    e->run.data = (dataset){0};
}

/* Hands the maps of the look on to a training of pod that had no trial. */
static void hand_on_look(trial_look *l, trial_gain *gain)
{
    gain->maps = l->maps;
    l->maps = (dataset){0};
}

sdm_status trainer_race(trainer *t, sdm_config *scratch, training_turns *out, trial_gain gain[2],
                        sdm_error *err)
{
    entrant e[] = {{.kind = SDM_NETWORK_TEMPLATE, .race = t}, {.kind = SDM_NETWORK_POD, .race = t}};
    turn_figures figures[2];
    trial_look l = {0};
    size_t n = 0;
    double pod_minutes = 0;
    t->phase = SDM_PHASE_TRIAL;
    sdm_status s = look(t, scratch, &l, &pod_minutes, err);
    const haste h = haste_of(t, &l);
    e[0].only_ready = h == HASTE_FIRST;
    // where a template is likely to be kept, its trial is the beginning of its training
    if (!s && h != HASTE_POD) s = try_kind(t, scratch, &l.maps, &e[0], err);
    const bool done =
        e[0].finished && trainer_score(&e[0].errors) < ENOUGH * t->config->grid.spacing[0];
    if (!s && e[0].finished && !done && h == HASTE_NONE)
        s = try_kind(t, scratch, &l.maps, &e[1], err);
    if (!s) {
        const char *reason = decide(t, &l, &e[0], &e[1], done, out);
        // minutes for a later training of pod; where pod is trained now, its report has them
        out->pod_minutes = out->kind[0] == SDM_NETWORK_POD ? 0 : pod_minutes;
        const entrant *other = out->kind[0] == e[0].kind ? &e[1] : &e[0];
        out->tried_other = other->finished;
        // a kind that the shape does not allow, or that is not needed, has no trial later either
        const bool open = h != HASTE_NONE && !done && !e[0].left_out[0] && !out->tried_other;
        out->trial_minutes = open ? trial_minutes(&l) : 0;
        out->template_seconds = open ? untried_template_seconds(t, &l, &e[0]) : 0;
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
        if (winner->finished)
            hand_on(winner, &gain[i]);
        else if (winner == &e[1])
            hand_on_look(&l, &gain[i]);
    }
    for (size_t i = 0; i < 2; i++) entrant_dispose(&e[i]);
    trainer_dataset_dispose(&l.maps);
    t->phase = SDM_PHASE_DATA;
    return s;
}
