/* sdmgen train: trains the network of a configuration and writes a run folder with the model. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "commands.h"
#include "inputs/config_shape.h"
#include "inputs/ranks.h"
#include "inputs/setup.h"
#include "page/page.h"
#include "report/files.h"
#include "report/report_verdict.h"
#include "report/terminal.h"
#include "report/train_progress.h"
#include "sdm/internal/threads.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"
#include "sdm/picture.h"
#include "study/evaluate.h"
#include "survey/report_survey.h"
#include "train/model_before.h"
#include "train/next_training.h"
#include "train/other_kind.h"
#include "train/print_plan.h"

/* Draws slices exact | network | error at the default parameters of the model. */
static sdm_status write_picture(const sdm_model *model, const sdm_instance *shape,
                                const char *folder, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    double p[SDM_MAX_PARAMS];
    const sdm_model_info *info = sdm_model_get_info(model);
    for (size_t i = 0; i < info->n_params && i < SDM_MAX_PARAMS; i++) p[i] = info->params[i].def;
    snprintf(path, sizeof path, "%s/slices.png", folder);
    return cli_picture_compare(model, shape, 0, 0, p, path, err);
}

/* Draws slices.png and measures the time of a map with the finished model. The model is good even
 * if either fails: that is told, and the times that are missing are NaN. */
static sdm_status look_at_model(const char *model_path, const sdm_instance *shape,
                                const char *folder, cli_timing *times, sdm_error *err)
{
    sdm_model *model = NULL;
    sdm_error picture = {0}, timing = {0};
    sdm_status s = sdm_model_open(model_path, &model, err);
    // without SDM_PICTURE, the notice about loss.png says enough
    if (!s && !sdm_picture_check("slices.png", NULL) &&
        write_picture(model, shape, folder, &picture))
        cli_notice("%s", picture.text);
    if (!s && cli_time_two(model, shape, times, &timing)) {
        s = cli_check_interrupt(err);
        if (!s) cli_warn("the time of a map was not measured: %s", timing.text);
    }
    sdm_model_free(model);
    return s;
}

/* "pod" or "template": a kind that network.kind: auto has trained. */
static const char *kind_name(sdm_network_kind kind)
{
    return kind == SDM_NETWORK_POD ? "pod" : "template";
}

/* Tells of several ranks, and what memory they needed. */
static void print_ranks(const cli_ranks_use *use)
{
    int64_t least = use->memory[0], most = use->memory[0], all = 0;
    for (int i = 0; i < use->n; i++) {
        if (use->memory[i] < least) least = use->memory[i];
        if (use->memory[i] > most) most = use->memory[i];
        all += use->memory[i];
    }
    printf("  ranks       %d by %s; memory of a rank %.0f to %.0f MB, of all %.0f MB\n", use->n,
           use->by, 1e-6 * (double)least, 1e-6 * (double)most, 1e-6 * (double)all);
}

/* Tells of the kind that network.kind: auto has trained and not chosen, and what it was better at.
 */
static void print_other(const sdm_train_report *r)
{
    char other[16], own[16];
    printf(
        "  auto        trained %s, too (%s): RMSE %.5f mm, within a voxel of the surface %.5f mm, "
        "%.3g ms a map%s",
        kind_name(r->other_kind), sdm_grade_name(r->other_grade), r->other.rmse_mm,
        r->other_voxel_mm, r->other_ms,
        r->other_voxel_mm < r->verdict.rmse_voxel_mm ? "; better at the surface" : "");
    if (isfinite(r->other_derivative) && isfinite(r->verdict.derivative_error))
        printf("; derivatives of maps off by %s %%, those of %s by %s %%",
               cli_percent(r->other_derivative, other), kind_name(r->kind),
               cli_percent(r->verdict.derivative_error, own));
    if (r->other_path[0]) printf("; its model is %s", r->other_path);
    printf("\n");
}

/* before: the comparison with the model that the run has replaced, or the one of --compare.
 * minutes: train.minutes of the run. */
static sdm_status print_summary(const cli_args *args, const sdm_train_report *r,
                                const cli_timing *times, const cli_ranks_use *use,
                                const cli_before *before, double minutes, sdm_error *err)
{
    const sdm_accuracy *a = &r->accuracy;
    // print as JSON
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
        sdm_json_real(&j, "ms_network", times->ms_network);
        sdm_json_real(&j, "ms_exact", times->ms_exact);
        sdm_json_open(&j, "memory_bytes", '[');
        for (int i = 0; i < use->n; i++) sdm_json_int(&j, NULL, use->memory[i]);
        sdm_json_close(&j, ']');
        if (r->compared) {
            sdm_json_open(&j, "other", '{');
            sdm_json_text(&j, "kind", kind_name(r->other_kind));
            sdm_json_real(&j, "rmse_mm", r->other.rmse_mm);
            sdm_json_real(&j, "rmse_near_mm", r->other.rmse_near_mm);
            sdm_json_real(&j, "rmse_voxel_mm", r->other_voxel_mm);
            sdm_json_real(&j, "ms_network", r->other_ms);
            sdm_json_text(&j, "grade", sdm_grade_name(r->other_grade));
            sdm_json_text(&j, "model", r->other_path);
            sdm_json_close(&j, '}');
        }
        cli_before_json(before, &j);
        sdm_json_open(&j, "verdict", '{');
        sdm_verdict_json(&j, &r->verdict);
        sdm_json_real(&j, "saved_seconds", r->verdict.saved_seconds);
        sdm_json_close(&j, '}');
        sdm_json_close(&j, '}');
        return cli_print_json(&j, err);
    }
    // print as text
    char steps[32], maps[32];
    printf("%s\n", r->model_path);
    if (r->steps || r->samples)
        printf("  trained     %.1f s, %s steps, %s exact maps", r->seconds,
               cli_format_count(r->steps, steps), cli_format_count(r->samples, maps));
    else
        printf("  made        in %.1f s from meshes, without training steps%s", r->seconds,
               r->compared ? "; the other kind was trained to compare" : "");
    if (r->verdict.saved_seconds > 0 && r->steps)
        printf("; train.patience saved %.0f s", r->verdict.saved_seconds);
    const sdm_verdict *v = &r->verdict;
    printf("\n");
    cli_print_two("  time        ", times);
    if (use->n > 1) print_ranks(use);
    if (r->compared) print_other(r);
    cli_print_measurements(v);
    printf(
        "\n  held out    %lld shapes: RMSE %.5f mm (%.4f voxels), MSE %.3g mm^2; within a voxel of "
        "the surface %.5f mm (%.4f voxels); Dice %.4f, smallest %.4f\n",
        (long long)a->samples, a->rmse_mm, a->rmse_mm / v->voxel_mm, a->mse_mm2, v->rmse_voxel_mm,
        v->rmse_voxel_mm / v->voxel_mm, v->dice, v->dice_min);
    cli_print_verdict(v);
    cli_before_print(before);
    cli_print_pod(args, r, times, minutes);
    cli_print_next(args, r, r->chosen ? kind_name(r->kind) : NULL, times->ms_network, minutes);
    if (cli_warnings() > 0)
        printf("  warnings    %zu, at the beginning of the output%s\n", cli_warnings(),
               v->cut > 0 || sdm_verdict_broken(v) || v->triangles_by[0] ||
                       sdm_verdict_lacks_part(v) || !strncmp(v->key, "grid.", 5)
                   ? ""
                   : ": mend these first; the lines above do not consider them");
    return SDM_OK;
}

/* Does the folder hold a checkpoint from which --resume goes on? */
static bool has_checkpoint(const char *folder)
{
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/checkpoint.sdmc", folder);
    return !access(path, F_OK);
}

/* Compares the model with the one of before. The model is good even if this fails, which is told.
 */
static cli_before compare(const sdm_model *before, const char *path, const sdm_instance *shape)
{
    sdm_error why = {0};
    cli_before comparison;
    if (cli_before_measure(before, path, shape, &comparison, &why))
        cli_warn("the model was not compared with the one of before: %s", why.text);
    return comparison;
}

/* before: a model to compare the new one with; NULL: none. */
static sdm_status train_network(const cli_args *args, const sdm_config *config,
                                const sdm_registry *registry, const sdm_instance *shape,
                                const sdm_map_store *store, const sdm_model *before, sdm_comm *comm,
                                sdm_error *err)
{
    const char *folder = config->output.folder;
    const bool first = sdm_comm_rank(comm) == 0;
    double thin_spacing = NAN;
    cli_progress progress;
    sdm_train_hooks hooks = cli_train_hooks(&progress);
    hooks.store = store;
    sdm_train_report report = {0};
    hooks.comm = comm;
    // a run that goes on has told it at its beginning
    if (first && !(args->resume && has_checkpoint(folder)))
        (void)cli_notice_survey(config, shape, cli_other_process(args, registry, shape),
                                &thin_spacing);
    if (first) cli_progress_start(&progress);
    sdm_status s = sdm_train(config, shape, folder, args->resume, &hooks, &report, err);
    if (first) cli_progress_end(&progress, !s);
    cli_ranks_use use = {0};
    if (!s) s = cli_ranks_measure(comm, &use, err);
    s = cli_ranks_end(comm, s, err);
    cli_timing times;
    if (!s) s = look_at_model(report.model_path, shape, folder, &times, err);
    if (!s) {
        const cli_before comparison = compare(before, report.model_path, shape);
        cli_show_part_first(&report, thin_spacing, config->train.minutes);
        s = print_summary(args, &report, &times, &use, &comparison, config->train.minutes, err);
    }
    sdm_free(use.memory);
    return s || !args->report
               ? s
               : cli_page_report(args, folder, cli_page_has_runtime(), args->report, err);
}

/* Each process that --ranks makes has its part of the threads, unless the configuration gives a
 * number. */
static void share_threads(const cli_args *args, sdm_config *config)
{
    const int n = args->ranks > 1 && !config->threads ? sdm_threads(0) / (int)args->ranks : 0;
    if (args->ranks > 1 && !config->threads) config->threads = n > 1 ? n : 1;
}

/* Refuses options that do nothing in a plan, but --out and --compare, which every advised command
 * has. */
static sdm_status check_plan(const cli_args *args, sdm_error *err)
{
    const struct {
        const char *name;
        bool given;
    } options[] = {{"--ranks", args->ranks > 0},
                   {"--resume", args->resume},
                   {"--force", args->force},
                   {"--report", args->report != NULL},
                   {"--dataset", args->dataset != NULL}};
    for (size_t i = 0; i < sizeof options / sizeof *options; i++)
        if (options[i].given)
            return sdm_fail(err, SDM_E_ARG, "--plan trains nothing: leave out %s", options[i].name);
    return SDM_OK;
}

sdm_status cmd_train(const cli_args *args, sdm_error *err)
{
    sdm_config *config = NULL;
    sdm_registry *registry = NULL;
    sdm_instance *shape = NULL;
    sdm_comm *comm = NULL;
    sdm_map_store *store = NULL;
    sdm_model *before = NULL;
    sdm_status s = cli_page_check_option(args, err);
    if (!s && (args->nodes || args->cores) && !args->plan)
        s = sdm_fail(err, SDM_E_ARG, "--nodes and --cores belong to --plan");
    if (!s && args->plan) s = check_plan(args, err);
    const bool trains = !args->plan;
    if (!s && trains) s = cli_ranks_start(args, &comm, err);
    if (!s) s = cli_open_config(args, &config, &registry, &shape, err);
    if (!s && args->out && strlen(args->out) >= sizeof config->output.folder)
        s = sdm_fail(err, SDM_E_ARG, "--out '%.100s...': the name is too long", args->out);
    if (!s && args->out) strcpy(config->output.folder, args->out);
    if (!s && !trains)
        (void)cli_notice_survey(config, shape, cli_other_process(args, registry, shape), NULL);
    if (!s && !trains) s = cli_plan_training(args, config, shape, err);
    if (!s && trains && !sdm_comm_rank(comm))
        s = sdm_train_check_folder(config->output.folder, args->resume, args->force, err);
    if (!s && trains && !sdm_comm_rank(comm) && (args->force || args->compare))
        s = cli_before_open(args->compare, config->output.folder, shape, &before, err);
    // a page in the folder of the run, which the training makes, needs no check
    const size_t n = strlen(config ? config->output.folder : "");
    if (!s && trains && args->report && (strncmp(args->report, config->output.folder, n) || !n))
        s = cli_check_files(args, NULL, err);
    if (!s && trains && args->dataset)
        s = sdm_map_store_open(args->dataset, config, shape, NULL, NULL, &store, err);
    if (!s && store) s = sdm_map_store_compare(store, config, shape, err);
    s = sdm_comm_agree(comm, s, err);
    if (!s && trains) {
        share_threads(args, config);
        s = train_network(args, config, registry, shape, store, before, comm, err);
    } else if (trains) {
        s = cli_ranks_end(comm, s, err);
    }
    sdm_model_free(before);
    sdm_map_store_free(store);
    sdm_instance_free(shape);
    sdm_registry_free(registry);
    sdm_free(config);
    return s;
}
