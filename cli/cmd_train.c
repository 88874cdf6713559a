/* sdmgen train: from a configuration to a run folder with a trained model. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "commands.h"
#include "config_shape.h"
#include "evaluate.h"
#include "progress.h"
#include "sdm/memory.h"
#include "sdm/train.h"
#include "setup.h"
#include "terminal.h"

static const char *phase_name(sdm_phase phase)
{
    switch (phase) {
    case SDM_PHASE_DATA:
        return "data";
    case SDM_PHASE_BASES:
        return "bases";
    case SDM_PHASE_FIT:
        return "fit";
    case SDM_PHASE_REFINE:
        return "refine";
    default:
        return "evaluate";
    }
}

static void add_time(char *buf, size_t size, double seconds)
{
    if (!(seconds >= 0) || seconds > 1e8)
        snprintf(buf, size, "-:--");
    else if (seconds < 3600)
        snprintf(buf, size, "%d:%02d", (int)seconds / 60, (int)seconds % 60);
    else
        snprintf(buf, size, "%d:%02d:%02d", (int)seconds / 3600, (int)seconds / 60 % 60, (int)seconds % 60);
}

/* 850, 18k, 2.1M */
static void format_rate(char buf[32], double rate)
{
    if (!(rate >= 0)) rate = 0;
    if (rate < 9999.5)
        snprintf(buf, 32, "%.0f", rate);
    else if (rate < 999.5e3)
        snprintf(buf, 32, "%.0fk", rate / 1e3);
    else
        snprintf(buf, 32, "%.1fM", rate / 1e6);
}

static void on_progress(void *user, const sdm_progress *p)
{
    char count[32], loss[32] = "-", error[32] = "-", left[32], rate[32], text[256];
    add_time(left, sizeof left, p->seconds_left);
    if (p->phase == SDM_PHASE_DATA || p->phase == SDM_PHASE_BASES) {
        snprintf(text, sizeof text, "%s exact maps  %s left", cli_format_count(p->samples, count), left);
    } else {
        if (isfinite(p->loss)) snprintf(loss, sizeof loss, "%.1e", p->loss);
        if (isfinite(p->heldout_rmse_mm)) snprintf(error, sizeof error, "%.4f mm", p->heldout_rmse_mm);
        format_rate(rate, p->samples_per_second);
        snprintf(text, sizeof text, "step %s  loss %s  held-out %s  %s left  %s samples/s",
                 cli_format_count(p->step, count), loss, error, left, rate);
    }
    cli_progress_show(user, phase_name(p->phase), p->fraction, text);
}

static void on_message(void *user, const char *line)
{
    cli_progress_clear(user);
    cli_notice("%s", line);
}

static bool on_question(void *user)
{
    (void)user;
    return cli_is_interrupted();
}

/* A finished model or a checkpoint is never overwritten by mistake. */
static sdm_status check_folder(const cli_args *args, const char *folder, sdm_error *err)
{
    static const struct {
        const char *name, *what;
    } files[] = {{"model.sdm", "a trained model"}, {"checkpoint.sdmc", "the checkpoint of a training"}};
    if (args->resume && args->force) return sdm_fail(err, SDM_E_ARG, "train: --resume and --force exclude each other");
    bool there[2];
    for (size_t i = 0; i < 2; i++) {
        char path[SDM_PATH_TEXT_MAX + 32];
        snprintf(path, sizeof path, "%s/%s", folder, files[i].name);
        there[i] = !access(path, F_OK);
    }
    if (args->force || (!there[0] && !there[1])) return SDM_OK;
    if (!there[1])
        return sdm_fail(err, SDM_E_ARG,
                        "%s holds %s and no checkpoint to go on from: start anew with --force, or choose --out DIR",
                        folder, files[0].what);
    if (args->resume) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG, "%s holds %s: go on with --resume, start anew with --force, or choose --out DIR",
                    folder, files[there[0] ? 0 : 1].what);
}

/* Slices exact | network | error at the shape's default parameters, as far as the model was trained on them. */
static sdm_status write_picture(const sdm_train_report *report, const sdm_instance *shape, const char *folder,
                                sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    double p[SDM_MAX_PARAMS];
    sdm_model *model = NULL;
    sdm_status s = sdm_model_open(report->model_path, &model, err);
    if (s) return s;
    const sdm_model_info *info = sdm_model_get_info(model);
    for (size_t i = 0; i < info->n_params && i < SDM_MAX_PARAMS; i++) p[i] = info->params[i].def;
    snprintf(path, sizeof path, "%s/slices.png", folder);
    s = cli_picture_compare(model, shape, 0, 0, p, path, err);
    sdm_model_free(model);
    return s;
}

static sdm_status print_summary(const cli_args *args, const sdm_train_report *r, sdm_error *err)
{
    const sdm_accuracy *a = &r->accuracy;
    if (args->json) {
        sdm_json j = {0};
        sdm_json_open(&j, NULL, '{');
        sdm_json_real(&j, "seconds", r->seconds);
        sdm_json_real(&j, "mse_mm2", a->mse_mm2);
        sdm_json_text(&j, "model", r->model_path);
        sdm_json_real(&j, "rmse_mm", a->rmse_mm);
        sdm_json_real(&j, "mae_mm", a->mae_mm);
        sdm_json_real(&j, "max_abs_mm", a->max_abs_mm);
        sdm_json_real(&j, "rmse_near_mm", a->rmse_near_mm);
        sdm_json_int(&j, "heldout", a->samples);
        sdm_json_int(&j, "steps", r->steps);
        sdm_json_int(&j, "maps", r->samples);
        sdm_json_close(&j, '}');
        return cli_print_json(&j, err);
    }
    char steps[32], maps[32];
    printf("%s\n", r->model_path);
    printf("  trained     %.1f s, %s steps, %s exact maps\n", r->seconds, cli_format_count(r->steps, steps),
           cli_format_count(r->samples, maps));
    printf("  held out    %lld shapes: MSE %.3g mm^2, RMSE %.5f mm, within 0.4 mm of the surface %.5f mm, largest %.5f "
           "mm\n",
           (long long)a->samples, a->mse_mm2, a->rmse_mm, a->rmse_near_mm, a->max_abs_mm);
    return SDM_OK;
}

static sdm_status fail_interrupted(const char *folder, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/checkpoint.sdmc", folder);
    if (access(path, F_OK)) return sdm_fail(err, SDM_E_CANCELLED, "interrupted before the first checkpoint");
    return sdm_fail(err, SDM_E_CANCELLED, "interrupted; a checkpoint is in %s: go on with --resume", folder);
}

static sdm_status train(const cli_args *args, const sdm_config *config, const sdm_instance *shape, sdm_error *err)
{
    const char *folder = config->output.folder;
    cli_progress progress;
    const sdm_train_hooks hooks = {
        .progress = on_progress, .cancelled = on_question, .message = on_message, .user = &progress};
    sdm_train_report report = {0};
    cli_progress_start(&progress);
    sdm_status s = sdm_train(config, shape, folder, args->resume, &hooks, &report, err);
    cli_progress_clear(&progress);
    if (s == SDM_E_CANCELLED) return fail_interrupted(folder, err);
    if (!s) s = write_picture(&report, shape, folder, err);
    return s ? s : print_summary(args, &report, err);
}

sdm_status cmd_train(const cli_args *args, sdm_error *err)
{
    sdm_config *config = NULL;
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_status s = cli_read_config(args, &config, err);
    if (!s && args->out && strlen(args->out) >= sizeof config->output.folder)
        s = sdm_fail(err, SDM_E_ARG, "--out '%.100s...': the name is too long", args->out);
    if (!s && args->out) strcpy(config->output.folder, args->out);
    if (!s) s = check_folder(args, config->output.folder, err);
    if (!s) s = cli_open_registry(args, &registry, err);
    if (!s) s = cli_config_shape(config, registry, &shape, err);
    if (!s) s = train(args, config, shape, err);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_free(config);
    return s;
}
