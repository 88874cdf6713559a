/* Short trials of kinds of networks. */
#include "race.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/dataset_fill.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"
#include "set_up.h"
#include "state/export_model.h"
#include "state/progress.h"

enum { HOLDOUT = 32, MAPS = 384, MAPS_MAX = 1024 };

/* A kind of network in the race. */
typedef struct entrant {
    sdm_network_kind kind;
    const char *name;
    bool finished; /* false: the shape does not allow this kind */
    sdm_accuracy accuracy;
    double seconds;
    trainer run; /* its trial; run.kind is NULL without one */
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

/* The configuration of a trial: a few maps, no optimiser steps. */
static void trial_config(const sdm_config *from, size_t n_params, sdm_network_kind kind,
                         sdm_config *c)
{
    *c = *from;
    sdm_config_choose_kind(c, kind);
    // four maps determine a polynomial; of degree 2 where that is within bounds
    size_t maps = 4 * sdm_poly_count(n_params, 2) + 4;
    maps = maps < MAPS ? MAPS : maps > MAPS_MAX ? MAPS_MAX : maps;
    size_t all = (size_t)from->data.start;
    size_t grid = from->data.n_static_counts ? 1 : 0;
    for (size_t i = 0; i < n_params && grid && grid < MAPS_MAX; i++)
        grid *= (size_t)from->data.static_counts[from->data.n_static_counts == 1 ? 0 : i];
    all += grid < MAPS_MAX ? grid : MAPS_MAX;
    c->data.start = (int64_t)(all < maps ? (all ? all : 1) : maps);
    c->data.n_static_counts = 0;
    c->data.online = 0;
    c->data.sampling = SDM_SAMPLING_UNIFORM;
    if (c->data.holdout > HOLDOUT) c->data.holdout = HOLDOUT;
    c->network.depth = 0;
    c->network.modes = c->network.modes < 256 ? c->network.modes : 256;
    c->train.refine = 0;
    c->train.minutes = 0, c->train.samples = 0, c->train.steps = 1;
}

static bool trial_cancelled(void *user) { return trainer_cancelled(user); }

/* Trains and measures one entrant. Keeps its design and its maps. */
static sdm_status trial(trainer *t, const sdm_config *config, entrant *e, sdm_error *err)
{
    sdm_text metrics = {0};
    trainer *r = &e->run;
    *r = (trainer){.config = config,
                   .shape = t->shape,
                   .kind = trainer_kind_find(e->kind),
                   .hooks = {.cancelled = t->hooks.cancelled, .user = t->hooks.user},
                   .n_threads = t->n_threads,
                   .started = sdm_clock(),
                   .loss = NAN,
                   .heldout_mse = NAN,
                   .evaluated_step = -1,
                   .metrics = &metrics};
    const fill_hooks hooks = {.cancelled = trial_cancelled, .user = r};
    sdm_error reason = {0};
    sdm_status s = trainer_set_up(r, &reason);
    if (s == SDM_E_UNSUPPORTED && e->kind != SDM_NETWORK_POD) {
        trainer_message(t, "auto: %s is left out: %s", e->name, reason.text);
        s = SDM_OK;
    } else {
        if (s && err) *err = reason;
        if (!s) s = trainer_dataset_fill(&r->data, r->n_threads, &hooks, err);
        if (!s) s = trainer_check_grid(r, err);
        if (!s) s = r->kind->begin(r, err);
        if (!s) {
            trainer_enter(r, SDM_PHASE_MODE_FIT);
            s = r->kind->run(r, false, err);
        }
        if (!s) s = trainer_export_measure(r, &e->accuracy, err);
        e->finished = !s;
    }
    e->seconds = trainer_seconds(r);
    r->metrics = NULL;
    sdm_text_dispose(&metrics);
    return s;
}

/* Figure of merit, mm: the error near the surface counts most, the error far from it a tenth. */
static double merit(const sdm_accuracy *a)
{
    return sqrt(a->rmse_near_mm * a->rmse_near_mm + 0.01 * a->mse_mm2);
}

/* Appends a line with the result to t->metrics. */
static sdm_status add_record(const trainer *t, const entrant *e, size_t n, const entrant *best,
                             sdm_error *err)
{
    char key[64];
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", "auto");
    sdm_json_text(&j, "kind", best->name);
    for (size_t i = 0; i < n; i++) {
        if (!e[i].finished) continue;
        snprintf(key, sizeof key, "%s_rmse_mm", e[i].name);
        sdm_json_real(&j, key, e[i].accuracy.rmse_mm);
        snprintf(key, sizeof key, "%s_rmse_near_mm", e[i].name);
        sdm_json_real(&j, key, e[i].accuracy.rmse_near_mm);
    }
    sdm_json_close(&j, '}');
    if (!j.text.failed) sdm_text_add(t->metrics, "%s\n", j.text.data);
    const bool failed = j.text.failed || t->metrics->failed;
    sdm_json_dispose(&j);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the metrics") : SDM_OK;
}

/* Hands the design and the maps of the entrant on to the training. */
static void hand_on(entrant *e, trainer *t)
{
    t->design = e->run.design;
    t->tried = e->run.data;
    e->run.design = NULL;
    e->run.data = (dataset){0};
}

sdm_status trainer_race(trainer *t, sdm_config *out, sdm_error *err)
{
    // with an error this small near the surface no other kind is tried
    const double enough = t->config->grid.spacing[0] / 500;
    entrant e[] = {{.kind = SDM_NETWORK_TEMPLATE, .name = "template"},
                   {.kind = SDM_NETWORK_POD, .name = "pod"}};
    const size_t n = sizeof e / sizeof *e;
    size_t n_params;
    sdm_instance_params(t->shape, &n_params);
    entrant *best = NULL;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < n && !s; i++) {
        if (i + 1 == n && !best) {
            best = &e[i]; // the only kind left: no trial
            break;
        }
        trial_config(t->config, n_params, e[i].kind, out);
        s = trial(t, out, &e[i], err);
        if (s || !e[i].finished) {
            entrant_dispose(&e[i]);
            continue;
        }
        trainer_message(t,
                        "auto: %s leaves %.2g mm near the surface, %.2g mm everywhere (trial on "
                        "%lld maps, %.0f s)",
                        e[i].name, e[i].accuracy.rmse_near_mm, e[i].accuracy.rmse_mm,
                        (long long)out->data.start, e[i].seconds);
        const bool better = !best || merit(&e[i].accuracy) < merit(&best->accuracy);
        entrant *worse = better ? best : &e[i];
        if (better) best = &e[i];
        if (worse) entrant_dispose(worse);
        if (merit(&best->accuracy) < enough) break;
    }
    if (!s) {
        *out = *t->config;
        sdm_config_choose_kind(out, best->kind);
        trainer_message(t, "auto: network.kind is %s", best->name);
        s = add_record(t, e, n, best, err);
        if (!s && best->finished) hand_on(best, t);
    }
    for (size_t i = 0; i < n; i++) entrant_dispose(&e[i]);
    return s;
}
