/* Checkpoints: the data with which a run continues with the same bits. Maps and bases are computed
   again from configuration and seed, which gives the same bits; weights, moments, averages,
   counters, the sample plan and the metrics are stored. */
#include "checkpoint.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "export_model.h"
#include "history.h"
#include "kind.h"
#include "progress.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/internal/text.h"
#include "sdm/memory.h"

/* Content of the section "checkpoint". The file format is this struct: do not reorder. */
typedef struct counters {
    double seconds, phase_started, last_evaluation, loss, heldout_mse;
    int64_t phase, step, phase_step, n_start, n_taken;
    // train_kind.fingerprint(): the weights are valid only with these maps and bases
    uint64_t bases;
} counters;

static void checkpoint_path(const trainer *t, char *path, size_t size)
{
    snprintf(path, size, "%s/checkpoint.sdmc", t->folder);
}

static sdm_status remove_file(const trainer *t, const char *name, sdm_error *err)
{
    if (!trainer_writes(t)) return SDM_OK;
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/%s", t->folder, name);
    if (unlink(path) && errno != ENOENT)
        return sdm_fail(err, SDM_E_IO, "%s: cannot remove: %s", path, strerror(errno));
    return SDM_OK;
}

sdm_status trainer_checkpoint_remove(const trainer *t, sdm_error *err)
{
    return remove_file(t, "checkpoint.sdmc", err);
}

sdm_status trainer_checkpoint_clear_folder(const trainer *t, sdm_error *err)
{
    sdm_status s = trainer_checkpoint_remove(t, err);
    if (!s) s = remove_file(t, "model.sdm", err);
    if (!s) s = remove_file(t, trainer_turn_file(SDM_NETWORK_POD), err);
    if (!s) s = remove_file(t, trainer_turn_file(SDM_NETWORK_TEMPLATE), err);
    return s;
}

/* Writes the file; t has all weights. */
static sdm_status write_file(trainer *t, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    checkpoint_path(t, path, sizeof path);
    const parameters *p = t->kind->weights(t);
    // counters and configuration
    const counters now = {.seconds = trainer_seconds(t),
                          .phase_started = t->phase_started,
                          .last_evaluation = t->last_evaluation,
                          .loss = t->loss,
                          .heldout_mse = t->heldout_mse,
                          .phase = t->phase,
                          .step = t->step,
                          .phase_step = t->phase_step,
                          .n_start = (int64_t)t->data.n_start,
                          .n_taken = (int64_t)t->data.n_taken,
                          .bases = t->kind->fingerprint(t)};
    const double best[3] = {p->best_mse, p->gain_mse, p->gain_at};
    sdm_text config = {0};
    sdm_status s = trainer_export_dump(t, &config, err);
    // sections; the sample plan is stored only if it depends on observations
    const sdm_section sections[] = {
        {"meta", "kind=checkpoint\n", 16},
        {"config", config.data, config.size},
        {"checkpoint", &now, sizeof now},
        {"metrics", t->metrics->data, t->metrics->size},
        {"weights", p->w, p->n * sizeof *p->w},
        {"moment1", p->m, p->n * sizeof *p->m},
        {"moment2", p->v, p->n * sizeof *p->v},
        {"average", p->average, p->n * sizeof *p->average},
        {"best", p->best, p->n * sizeof *p->best},
        {"best.errors", best, sizeof best},
        {"turns", t->turns, t->turns->chosen ? sizeof *t->turns : 0},
        {"points", t->data.plan.point, t->data.plan.n_planned * sizeof *t->data.plan.point},
        {"errors", t->data.plan.error, t->data.plan.n_planned * sizeof *t->data.plan.error}};
    uint8_t *bytes = NULL;
    size_t size = 0;
    const size_t n = sizeof sections / sizeof *sections - (t->data.plan.by_error ? 0 : 2);
    if (!s) s = sdm_container_build(sections, n, &bytes, &size, err);
    if (!s) s = sdm_container_write(path, bytes, size, err);
    sdm_free(bytes);
    sdm_text_dispose(&config);
    return s;
}

sdm_status trainer_checkpoint_write(trainer *t, sdm_error *err)
{
    sdm_status s = t->kind->gather ? t->kind->gather(t, err) : SDM_OK;
    if (s) return s;
    if (trainer_writes(t)) s = write_file(t, err);
    t->last_checkpoint = trainer_shared_seconds(t);
    return sdm_comm_agree(t->hooks.comm, s, err);
}

void trainer_checkpoint_if_due(trainer *t, double now)
{
    sdm_error reason = {0};
    if (!(now - t->last_checkpoint > t->config->train.checkpoint_seconds)) return;
    if (trainer_checkpoint_write(t, &reason) && !sdm_comm_broken(t->hooks.comm))
        trainer_warn(t, "no checkpoint, training goes on and tries again: %s", reason.text);
}

sdm_status trainer_stop(trainer *t, sdm_error *err)
{
    const sdm_status s = trainer_checkpoint_write(t, err);
    if (s) return s;
    return sdm_fail(err, SDM_E_CANCELLED,
                    "stopped on request at step %lld; a checkpoint is in %s: go on with --resume",
                    (long long)t->step, t->folder);
}

/* A checkpoint file in memory; free `bytes`. */
typedef struct checkpoint_file {
    uint8_t *bytes;
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n;
} checkpoint_file;

static const sdm_section *section_find(const checkpoint_file *o, const char *name)
{
    for (size_t i = 0; i < o->n; i++)
        if (strcmp(o->names[i], name) == 0) return &o->sections[i];
    return NULL;
}

/* *bytes = the file, for all ranks, which need not see the folder of rank 0. *found: false if there
 * is no file. */
static sdm_status read_bytes(const trainer *t, const char *path, uint8_t **bytes, size_t *size,
                             bool *found, sdm_error *err)
{
    sdm_comm *comm = t->hooks.comm;
    sdm_status s = SDM_OK;
    *found = !access(path, F_OK) || errno != ENOENT;
    if (trainer_writes(t) && *found) s = sdm_file_read(path, (size_t)64 << 30, bytes, size, err);
    s = sdm_comm_agree(comm, s, err);
    if (!s) s = sdm_comm_broadcast(comm, 0, found, sizeof *found, err);
    if (!s) s = sdm_comm_broadcast(comm, 0, size, sizeof *size, err);
    if (!s && *found && !trainer_writes(t)) s = SDM_ALLOC(bytes, *size, "checkpoint", err);
    return s || !*found ? s : sdm_comm_broadcast(comm, 0, *bytes, *size, err);
}

/* Reads the checkpoint file. *found: false, without an error, if there is no file. */
static sdm_status checkpoint_open(const trainer *t, checkpoint_file *o, bool *found, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    checkpoint_path(t, path, sizeof path);
    size_t size = 0;
    uint64_t checksum = 0;
    sdm_status s = read_bytes(t, path, &o->bytes, &size, found, err);
    if (s || !*found) return s;
    s = sdm_container_parse(o->bytes, size, o->sections, o->names, &o->n, &checksum, err);
    const sdm_section *c = s ? NULL : section_find(o, "checkpoint");
    if (!s &&
        (!c || c->size != sizeof(counters) || !section_find(o, "config") ||
         !section_find(o, "metrics") || !section_find(o, "weights") ||
         !section_find(o, "moment1") || !section_find(o, "moment2") || !section_find(o, "average")))
        s = sdm_fail(err, SDM_E_FORMAT, "not a checkpoint of this version");
    if (s) {
        sdm_free(o->bytes);
        o->bytes = NULL;
        return sdm_fail_in(err, s, "%s", path);
    }
    return SDM_OK;
}

/* Gives the same value to all settings in which a run and its continuation may differ: budget,
   intervals, folders, threads, paths of data files. */
static void config_neutralise(const trainer *t, sdm_config *c)
{
    const sdm_shape *shape = sdm_instance_shape(t->shape);
    for (size_t i = 0; i < c->shape.n_options; i++)
        for (uint32_t k = 0; k < shape->n_options;
             // paths only: changed contents change the fingerprint of the maps
             k++)
            if (shape->options[k].type == SDM_OPTION_FILE &&
                !strcmp(shape->options[k].name, c->shape.options[i].name))
                c->shape.options[i].value[0] = '\0';
    c->train.minutes = 1;
    c->train.steps = c->train.samples = 0;
    c->train.evaluate_seconds = c->train.checkpoint_seconds = 1;
    sdm_config_strip(c);
}

static sdm_status checkpoint_refuse(const trainer *t, const char *what, sdm_error *err)
{
    return sdm_fail(err, SDM_E_CONFIG,
                    "%s/checkpoint.sdmc %s: start anew with --force, or choose another folder",
                    t->folder, what);
}

/* Skips the indent of a line of text; returns the length of the rest, at most 200, for "%.*s". */
static int line_length(const char **text)
{
    *text += strspn(*text, " ");
    const size_t n = strcspn(*text, "\n");
    return n < 200 ? (int)n : 200;
}

/* Error message with the first line in which two dumps of a configuration differ. */
static sdm_status checkpoint_refuse_line(const trainer *t, const char *old, const char *now,
                                         sdm_error *err)
{
    char what[512];
    size_t line = 0;
    for (size_t i = 0; old[i] && old[i] == now[i]; i++)
        if (old[i] == '\n') line = i + 1;
    old += line, now += line;
    const int n_old = line_length(&old), n_now = line_length(&now);
    snprintf(what, sizeof what, "has '%.*s', this configuration '%.*s'", n_old, old, n_now, now);
    return checkpoint_refuse(t, what, err);
}

/* The budget may change, but not to less than the checkpoint has used: the model would then have
 * been trained longer than its configuration states. */
static sdm_status check_budget(const trainer *t, const sdm_config *old, const counters *then,
                               sdm_error *err)
{
    char what[160];
    const double minutes = t->config->train.minutes;
    if ((minutes > 0) != (old->train.minutes > 0))
        return checkpoint_refuse(
            t, "and this configuration have budgets of different kinds (minutes; steps or samples)",
            err);
    if (trainer_by_time(t) && (minutes >= old->train.minutes || then->seconds <= minutes * 60))
        return SDM_OK;
    if (trainer_by_time(t))
        snprintf(what, sizeof what, "is at %.3g minutes, this configuration ends at %.3g",
                 then->seconds / 60, minutes);
    else if (then->step > trainer_steps(t))
        snprintf(what, sizeof what, "is at step %lld, this configuration ends at %lld",
                 (long long)then->step, (long long)trainer_steps(t));
    else
        return SDM_OK;
    return checkpoint_refuse(t, what, err);
}

/* SDM_E_CONFIG unless both configurations train the same network. Both are modified
 * (config_neutralise()). */
static sdm_status config_compare(const trainer *t, sdm_config *old, sdm_config *now, sdm_error *err)
{
    sdm_text a = {0}, b = {0};
    config_neutralise(t, old);
    config_neutralise(t, now);
    sdm_config_dump(old, &a);
    sdm_config_dump(now, &b);
    sdm_status s = SDM_OK;
    if (a.failed || b.failed)
        s = sdm_fail(err, SDM_E_NOMEM, "no memory to compare configs");
    else if (strcmp(a.data, b.data) != 0)
        s = checkpoint_refuse_line(t, a.data, b.data, err);
    sdm_text_dispose(&a);
    sdm_text_dispose(&b);
    return s;
}

static sdm_status check_config(const trainer *t, const sdm_section *stored, const counters *then,
                               sdm_error *err)
{
    sdm_config *old = NULL, *now = NULL;
    sdm_status s = SDM_ALLOC(&old, 1, "config", err);
    if (!s) s = SDM_ALLOC(&now, 1, "config", err);
    if (!s) s = sdm_config_parse("checkpoint", stored->data, stored->size, NULL, 0, old, err);
    if (!s) s = check_budget(t, old, then, err);
    if (!s) {
        *now = *t->config;
        s = config_compare(t, old, now, err);
    }
    sdm_free(old);
    sdm_free(now);
    return s;
}

/* Restores the sample plan: points and observed errors of all samples that are planned. t->data
 * must have its counters. */
static sdm_status plan_read(const trainer *t, const checkpoint_file *o, sample_plan *p,
                            sdm_error *err)
{
    if (!p->by_error) return SDM_OK;
    const sdm_section *points = section_find(o, "points"), *errors = section_find(o, "errors");
    const size_t n = points ? points->size / sizeof *p->point : 0;
    bool sound = errors && n >= t->data.n_taken && n <= p->n &&
                 points->size == n * sizeof *p->point && errors->size == n * sizeof *p->error;
    if (sound) {
        memcpy(p->point, points->data, points->size);
        memcpy(p->error, errors->data, errors->size);
        for (size_t i = 0; i < n; i++)
            sound =
                sound && (i < t->data.n_start ? p->point[i] == i : p->point[i] > p->point[i - 1]);
    }
    if (!sound)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s/checkpoint.sdmc: its sampling plan contradicts its counters",
                        t->folder);
    p->n_planned = n;
    return SDM_OK;
}

/* The bytes of a bool in a file are not to be read as one before they are known to be 0 or 1. */
static bool is_bool(const bool *stored)
{
    uint8_t byte;
    memcpy(&byte, stored, sizeof byte);
    return byte <= 1;
}

static bool ends(const char *text, size_t size) { return memchr(text, '\0', size); }

/* true: the result of the first training can be used without reading beyond its texts. */
static bool report_is_sound(const sdm_train_report *r)
{
    const sdm_verdict *v = &r->verdict;
    return ends(v->derivatives_bad, SDM_VERDICT_LIST) &&
           ends(v->volume_derivatives_bad, SDM_VERDICT_LIST) &&
           ends(v->volume_derivatives_small, SDM_VERDICT_LIST) &&
           ends(v->volume_causes, SDM_VERDICT_LIST) && ends(v->still_params, SDM_VERDICT_LIST) &&
           ends(v->derivative_by, sizeof v->derivative_by) &&
           ends(v->volume_derivative_by, sizeof v->volume_derivative_by) &&
           ends(v->volume_own_by, sizeof v->volume_own_by) && r->steps >= 0 && r->seconds >= 0 &&
           ends(r->model_path, sizeof r->model_path) && ends(r->other_path, sizeof r->other_path) &&
           (unsigned)r->other_grade <= SDM_GRADE_POOR && is_bool(&r->compared) &&
           is_bool(&r->tried) && is_bool(&r->unfinished) && is_bool(&r->chosen) &&
           is_bool(&v->limited) && (unsigned)v->grade <= SDM_GRADE_POOR &&
           (unsigned)v->limit < SDM_CAUSES && ends(v->key, sizeof v->key) &&
           ends(v->triangles_by, sizeof v->triangles_by) && ends(v->sentence, sizeof v->sentence);
}

/* Reads the turns of a run with network.kind: auto. */
static sdm_status turns_read(const trainer *t, const sdm_section *stored, training_turns *out,
                             sdm_error *err)
{
    if (stored->size == sizeof *out) memcpy(out, stored->data, sizeof *out);
    bool sound = stored->size == sizeof *out && (out->n == 1 || out->n == 2) && out->at >= 0 &&
                 out->at < out->n && out->share > 0 && out->share <= 1 && out->tried >= 0 &&
                 isfinite(out->tried) && is_bool(&out->chosen) && is_bool(&out->untried) &&
                 is_bool(&out->if_good) && is_bool(&out->tried_other) && out->pod_minutes >= 0 &&
                 out->trial_minutes >= 0 && out->template_seconds >= 0 &&
                 report_is_sound(&out->first);
    for (int i = 0; i < out->n && sound; i++)
        sound = out->kind[i] == SDM_NETWORK_POD || out->kind[i] == SDM_NETWORK_TEMPLATE;
    return sound ? SDM_OK
                 : sdm_fail(err, SDM_E_FORMAT,
                            "%s/checkpoint.sdmc: its list of kinds is damaged or of another "
                            "version: start anew with --force",
                            t->folder);
}

sdm_status trainer_checkpoint_turns(const trainer *t, training_turns *out, bool *found,
                                    sdm_error *err)
{
    checkpoint_file o = {0};
    sdm_config *config = NULL;
    sdm_status s = checkpoint_open(t, &o, found, err);
    if (s || !*found) return s;
    const sdm_section *turns = section_find(&o, "turns"), *text = section_find(&o, "config");
    if (turns && turns->size) {
        s = turns_read(t, turns, out, err);
    } else {
        s = SDM_ALLOC(&config, 1, "configuration", err);
        if (!s) s = sdm_config_parse("checkpoint", text->data, text->size, NULL, 0, config, err);
        if (!s) *out = (training_turns){.n = 1, .kind = {config->network.kind}, .share = 1};
        out->chosen = true;
    }
    sdm_free(config);
    sdm_free(o.bytes);
    return s;
}

void trainer_tell_no_checkpoint(const trainer *t)
{
    trainer_message(t, "no checkpoint in %s: training starts from the beginning", t->folder);
}

/* Takes the metrics of the interrupted run, which are whole lines of text. */
static sdm_status metrics_read(const trainer *t, const sdm_section *metrics, sdm_error *err)
{
    const char *text = metrics->data;
    const size_t n = metrics->size;
    if (n && (n > INT_MAX || text[n - 1] != '\n' || memchr(text, '\0', n)))
        return sdm_fail(err, SDM_E_FORMAT, "%s/checkpoint.sdmc: its metrics are damaged",
                        t->folder);
    if (n) sdm_text_add(t->metrics, "%.*s", (int)n, text);
    return t->metrics->failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the metrics") : SDM_OK;
}

sdm_status trainer_checkpoint_read(trainer *t, bool *found, sdm_error *err)
{
    checkpoint_file o = {0};
    sdm_status s = checkpoint_open(t, &o, found, err);
    if (s || !*found) return s;
    counters then;
    memcpy(&then, section_find(&o, "checkpoint")->data, sizeof then);
    s = check_config(t, section_find(&o, "config"), &then, err);
    if (!s) {
        const dataset *d = &t->data;
        // refuse counters that contradict each other; all steps of the first phase are its own
        const bool sound = (then.phase == SDM_PHASE_REFINE ||
                            (then.phase == SDM_PHASE_MODE_FIT && then.step == then.phase_step)) &&
                           then.n_start >= 0 && (size_t)then.n_start <= d->n_start &&
                           then.n_taken >= then.n_start &&
                           (size_t)then.n_taken <= d->n_start + d->n_online &&
                           then.phase_step >= 0 && then.step >= then.phase_step &&
                           isfinite(then.seconds) && isfinite(then.last_evaluation) &&
                           then.phase_started >= 0 && then.seconds >= then.phase_started;
        if (!sound)
            s = sdm_fail(err, SDM_E_FORMAT,
                         "%s/checkpoint.sdmc: its counters contradict each other", t->folder);
        // restore the counters
        t->phase = (sdm_phase)then.phase;
        t->started -= then.seconds;
        t->phase_started = then.phase_started;
        t->last_evaluation = then.last_evaluation;
        t->loss = then.loss;
        t->heldout_mse = then.heldout_mse;
        t->step = then.step;
        t->phase_step = then.phase_step;
        t->data.n_taken = (size_t)then.n_taken; // the caller makes these samples again
        if (!s) {
            t->data.n_online += t->data.n_start - (size_t)then.n_start;
            t->data.n_start = (size_t)then.n_start;
        }
        if (!s) s = plan_read(t, &o, &t->data.plan, err);
        // restore the metrics
        if (!s) s = metrics_read(t, section_find(&o, "metrics"), err);
        history h = {0};
        if (!s) s = trainer_history_read(t, &h, err);
        t->evaluated_step = trainer_history_last_step(&h);
        trainer_history_dispose(&h);
    }
    sdm_free(o.bytes);
    return s;
}

sdm_status trainer_checkpoint_weights(trainer *t, sdm_error *err)
{
    checkpoint_file o = {0};
    bool found;
    sdm_status s = checkpoint_open(t, &o, &found, err);
    if (s) return s;
    if (!found) return sdm_fail(err, SDM_E_IO, "%s/checkpoint.sdmc: it has gone", t->folder);
    counters then;
    memcpy(&then, section_find(&o, "checkpoint")->data, sizeof then);
    // refuse weights that belong to other maps
    if (then.bases != t->kind->fingerprint(t))
        s = sdm_fail(err, SDM_E_CONFIG,
                     "%s/checkpoint.sdmc: the maps differ from those it was written with "
                     "(another plug-in, data "
                     "file or processor): "
                     "train without --resume",
                     t->folder);
    parameters *p = t->kind->weights(t);
    // restore the weights
    const struct {
        const char *name;
        float *to;
    } arrays[] = {{"weights", p->w},
                  {"moment1", p->m},
                  {"moment2", p->v},
                  {"average", p->average},
                  {"best", p->best}};
    // a checkpoint of an older version has no best weights
    const sdm_section *errors = section_find(&o, "best.errors");
    const int n_arrays = errors && errors->size == 3 * sizeof(double) ? 5 : 4;
    if (n_arrays == 5) {
        double best[3];
        memcpy(best, errors->data, sizeof best);
        p->best_mse = best[0], p->gain_mse = best[1], p->gain_at = best[2];
    }
    for (int i = 0; i < n_arrays && !s; i++) {
        const sdm_section *section = section_find(&o, arrays[i].name);
        if (!section || section->size != p->n * sizeof(float))
            s = sdm_fail(err, SDM_E_FORMAT,
                         "%s/checkpoint.sdmc: %zu bytes of %s, the network has %zu", t->folder,
                         section ? section->size : 0, arrays[i].name, p->n * sizeof(float));
        else
            memcpy(arrays[i].to, section->data, section->size);
    }
    sdm_free(o.bytes);
    return s;
}
