/* A row with a network: trained, gone on with or loaded, then measured. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "experiment_command.h"
#include "report/terminal.h"
#include "report/train_progress.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

#define MB 1e6
#define MB_OF_MIB 1.048576

/* No training is begun that would end too late. */
static sdm_status check_budget(const experiment_run *run, const experiment_job *job, sdm_error *err)
{
    const double limit = run->e->experiment.minutes, needed = job->config->train.minutes,
                 used = (sdm_clock() - run->start) / 60;
    if (!(limit > 0) || used + needed <= limit) return SDM_OK;
    return sdm_fail(
        err, SDM_E_QUALITY,
        "not trained: %.3g of %.3g minutes are used, its training takes %.3g (experiment.minutes)",
        used, limit, needed);
}

static sdm_status train(const experiment_run *run, const experiment_job *job, bool resume,
                        sdm_error *err)
{
    cli_progress progress;
    sdm_train_report report = {0};
    const sdm_train_hooks hooks = cli_train_hooks(&progress);
    const long before = bench_peak_start();
    cli_progress_start(&progress);
    const sdm_status s = sdm_train(job->config, job->shape, job->config->output.folder, resume,
                                   &hooks, &report, err);
    cli_progress_clear(&progress);
    if (!s)
        experiment_log(run, "%s: trained in %.1f s, peak of the memory %.0f MB",
                       run->e->rows[job->index].title, report.seconds,
                       MB_OF_MIB * bench_peak_mb(before));
    return s;
}

/* A checkpoint of other maps (another plug-in or data file) is refused; then training starts anew.
 */
sdm_status experiment_provide(const experiment_run *run, const experiment_job *job,
                              experiment_result *out, sdm_error *err)
{
    const experiment_stock stock = experiment_find(run, job);
    const char *title = out->row->title;
    out->loaded = stock == STOCK_MODEL;
    if (out->loaded) {
        experiment_log(run, "%s: the model in %s is loaded, not trained again", title,
                       job->config->output.folder);
        return SDM_OK;
    }
    sdm_status s = check_budget(run, job, err);
    if (s) return s;
    if (stock == STOCK_OTHER)
        experiment_log(
            run, "%s: the model or checkpoint in %s has another configuration and is replaced",
            title, job->config->output.folder);
    experiment_log(run, "%s: training%s, %s", title, stock == STOCK_CHECKPOINT ? " goes on" : "",
                   out->grid);
    s = train(run, job, stock == STOCK_CHECKPOINT, err);
    if (s == SDM_E_CONFIG && stock == STOCK_CHECKPOINT) {
        experiment_log(run, "%s: the checkpoint is of other maps; training starts anew", title);
        s = train(run, job, false, err);
    }
    return s;
}

static sdm_status measure_memory(const char *path, const double *p, float *values, double *mb,
                                 sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = SDM_RANGE_CLAMP, .n_threads = 1};
    sdm_model *model = NULL;
    const long before = bench_peak_start();
    sdm_status s = sdm_model_open(path, &model, err);
    if (!s) s = sdm_generate(model, p, &opts, values, NULL, err);
    *mb = bench_peak_mb(before);
    sdm_model_free(model);
    return s;
}

static sdm_status measure(const experiment_run *run, experiment_job *job, const char *path,
                          const sdm_model *model, experiment_result *out, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(model);
    const uint64_t seed = run->e->experiment.seed;
    cli_eval e = {0};
    cli_timing t = {0};
    float *values = NULL;
    const long before = bench_peak_start(); /* the map counts */
    double more = 0;
    sdm_status s = SDM_ALLOC(&values, sdm_grid_count(&info->grid), "distance map", err);
    if (!s) memset(values, 1, sdm_grid_count(&info->grid) * sizeof *values);
    const double map_mb = bench_peak_mb(before);
    if (!s) s = measure_memory(path, job->nominal, values, &more, err);
    if (!s) s = cli_time_maps(model, NULL, seed, false, 0, &t, err);
    job->maker = cli_maker_of_model(model, job->shape);
    if (!s) s = cli_evaluate_maps(&job->maker, seed, (size_t)out->row->samples, true, &e, err);
    if (!s) {
        experiment_set_errors(out, &e);
        out->figure[SDM_FIGURE_MS] = t.ms_network;
        out->figure[SDM_FIGURE_MS_BATCH] = t.ms_batch;
        if (info->train_seconds > 0)
            out->figure[SDM_FIGURE_TRAIN] = info->train_seconds; /* 0: a budget of steps */
        out->figure[SDM_FIGURE_MODEL] = (double)info->file_bytes / MB;
        out->figure[SDM_FIGURE_PEAK] = MB_OF_MIB * (map_mb + more);
        snprintf(out->note, sizeof out->note,
                 "network %s, %s, %lld maps seen in training, seed %llu%s", info->kind, out->grid,
                 (long long)info->train_samples, (unsigned long long)info->seed,
                 out->loaded ? "; loaded" : "");
        s = experiment_draw(run, job, values, err);
    }
    cli_eval_dispose(&e);
    sdm_free(values);
    return s;
}

sdm_status experiment_network(const experiment_run *run, experiment_job *job,
                              experiment_result *out, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX];
    sdm_model *model = NULL;
    sdm_status s = experiment_path(run, job->index, "model.sdm", path, err);
    if (!s) s = experiment_provide(run, job, out, err);
    if (!s) s = sdm_model_open(path, &model, err);
    if (!s) s = measure(run, job, path, model, out, err);
    sdm_model_free(model);
    return s;
}
