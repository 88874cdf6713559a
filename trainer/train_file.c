/* Trains from a configuration file, for programs that use the library. */
#include "sdm/train_file.h"

#include <stdio.h>
#include <string.h>

#include "sdm/internal/train.h"
#include "sdm/memory.h"

/* A run: what is freed at its end, and the callbacks of the caller. */
typedef struct training {
    const sdm_training_opts *opts;
    sdm_config *config;
    sdm_instance *shape;
} training;

static const char *phase_name(sdm_phase phase)
{
    static const char *const names[] = {"data", "bases", "fit", "refine", "evaluate", "trial"};
    return names[phase];
}

static void show_progress(void *user, const sdm_progress *p)
{
    const training *t = user;
    const sdm_training_progress shown = {.phase = phase_name(p->phase),
                                         .fraction = p->fraction,
                                         .step = p->step,
                                         .maps = p->samples,
                                         .loss_mm2 = p->loss,
                                         .heldout_rmse_mm = p->heldout_rmse_mm,
                                         .seconds = p->seconds,
                                         .seconds_left = p->seconds_left};
    t->opts->progress(t->opts->user, &shown);
}

static bool is_cancelled(void *user)
{
    const training *t = user;
    return t->opts->cancelled(t->opts->user);
}

static void show_message(void *user, const char *line)
{
    const training *t = user;
    t->opts->message(t->opts->user, line);
}

static sdm_status read_config(training *t, const char *path, sdm_error *err)
{
    const sdm_training_opts *o = t->opts;
    sdm_status s = SDM_ALLOC(&t->config, 1, "configuration", err);
    if (!s) s = sdm_config_read(path, o->settings, o->n_settings, t->config, err);
    char *folder = s ? NULL : t->config->output.folder;
    if (!folder || !o->folder) return s;
    if (strlen(o->folder) >= sizeof t->config->output.folder)
        return sdm_fail(err, SDM_E_ARG, "the folder '%.100s...': the name is too long", o->folder);
    strcpy(folder, o->folder);
    return SDM_OK;
}

static sdm_status make_shape(training *t, const sdm_registry *registry, sdm_error *err)
{
    sdm_config *c = t->config;
    const char *near = NULL;
    const sdm_shape *shape = sdm_registry_find(registry, c->shape.name, &near);
    if (shape) return sdm_train_shape(c, shape, &t->shape, err);
    char where[1200];
    return sdm_fail(err, SDM_E_CONFIG, "%s: unknown shape '%s'%s%s%s",
                    sdm_config_where(c, c->shape.mark, where), c->shape.name,
                    near ? "; did you mean '" : "", near ? near : "", near ? "'?" : "");
}

/* Completes a grid that is to be fitted to the shapes, and tells its numbers. */
static sdm_status fit_grid(const training *t, sdm_error *err)
{
    sdm_text line = {0};
    const sdm_status s = sdm_train_complete(t->config, t->shape, &line, err);
    if (!s && line.data && t->opts->message) t->opts->message(t->opts->user, line.data);
    sdm_text_dispose(&line);
    return s;
}

static sdm_status train(training *t, sdm_training_result *result, sdm_error *err)
{
    const sdm_training_opts *o = t->opts;
    const sdm_train_hooks hooks = {.progress = o->progress ? show_progress : NULL,
                                   .cancelled = o->cancelled ? is_cancelled : NULL,
                                   .message = o->message ? show_message : NULL,
                                   .user = t};
    sdm_train_report report = {.steps = 0};
    const sdm_status s =
        sdm_train(t->config, t->shape, t->config->output.folder, o->resume, &hooks, &report, err);
    if (s || !result) return s;
    *result = (sdm_training_result){.accuracy = report.accuracy,
                                    .steps = report.steps,
                                    .maps = report.samples,
                                    .seconds = report.seconds,
                                    .grade = sdm_grade_name(report.verdict.grade)};
    snprintf(result->model_path, sizeof result->model_path, "%s", report.model_path);
    snprintf(result->sentence, sizeof result->sentence, "%s", report.verdict.sentence);
    return SDM_OK;
}

sdm_status sdm_training_run(const char *path, const sdm_registry *registry,
                            const sdm_training_opts *opts, sdm_training_result *result,
                            sdm_error *err)
{
    static const sdm_training_opts defaults = {.settings = NULL};
    if (!path || !registry || (opts && opts->n_settings && !opts->settings))
        return sdm_fail(err, SDM_E_ARG, "training: a path and a registry are needed");
    training t = {.opts = opts ? opts : &defaults};
    sdm_status s = read_config(&t, path, err);
    if (!s) s = sdm_train_check_folder(t.config->output.folder, t.opts->resume, t.opts->force, err);
    if (!s) s = make_shape(&t, registry, err);
    if (!s) s = fit_grid(&t, err);
    if (!s) s = train(&t, result, err);
    sdm_instance_free(t.shape);
    sdm_free(t.config);
    return s;
}
