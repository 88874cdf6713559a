/* Rows of an experiment with a network: trains it, continues its training or loads it, then
 * measures it. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"
#include "experiment_command.h"
#include "report/terminal.h"
#include "report/train_progress.h"
#include "sdm/field.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"

#define MB 1e6
#define MB_OF_MIB 1.048576

/* Refuses a training that would end after experiment.minutes. */
static sdm_status check_budget(const cli_experiment_run *run, const cli_experiment_job *job,
                               sdm_error *err)
{
    const double limit = run->e->experiment.minutes, needed = job->config->train.minutes,
                 used = (sdm_clock() - run->start) / 60;
    if (!(limit > 0) || used + needed <= limit) return SDM_OK;
    return sdm_fail(
        err, SDM_E_QUALITY,
        "not trained: %.3g of %.3g minutes are used, its training takes %.3g (experiment.minutes)",
        used, limit, needed);
}

static sdm_status train_network(const cli_experiment_run *run, const cli_experiment_job *job,
                                bool resume, sdm_error *err)
{
    cli_progress progress;
    sdm_train_report report = {0};
    const sdm_train_hooks hooks = cli_train_hooks(&progress);
    sdm_status s = resume ? SDM_OK : cli_experiment_begin_asked(run, job, err);
    if (s) return s;
    const long before = cli_bench_peak_start();
    cli_progress_start(&progress);
    s = sdm_train(job->config, job->shape, job->config->output.folder, resume, &hooks, &report,
                  err);
    cli_progress_end(&progress, !s);
    if (!s) s = cli_experiment_end_asked(run, job, err);
    if (!s)
        cli_experiment_log(run, "%s: trained in %.1f s, peak memory %.0f MB",
                           run->e->rows[job->index].title, report.seconds,
                           MB_OF_MIB * cli_bench_peak_mb(before));
    return s;
}

/* sdm_train() refuses a checkpoint whose maps differ (another plug-in or data file); then the
 * training starts again. */
sdm_status cli_experiment_provide_model(const cli_experiment_run *run,
                                        const cli_experiment_job *job, cli_experiment_result *out,
                                        sdm_error *err)
{
    const cli_experiment_stored stored = cli_experiment_find_stored(run, job);
    const char *title = out->row->title;
    out->loaded = stored == CLI_STORED_MODEL;
    if (out->loaded) {
        cli_experiment_log(run, "%s: the model in %s is loaded, not trained again", title,
                           job->config->output.folder);
        return SDM_OK;
    }
    sdm_status s = check_budget(run, job, err);
    if (s) return s;
    if (stored == CLI_STORED_OTHER)
        cli_experiment_log(
            run, "%s: the model or checkpoint in %s has another configuration and is replaced",
            title, job->config->output.folder);
    cli_experiment_log(run, "%s: training%s, %s", title,
                       stored == CLI_STORED_CHECKPOINT ? " continues" : "", out->grid);
    s = train_network(run, job, stored == CLI_STORED_CHECKPOINT, err);
    if (s == SDM_E_CONFIG && stored == CLI_STORED_CHECKPOINT) {
        cli_experiment_log(run, "%s: the checkpoint has other maps; training starts again", title);
        s = train_network(run, job, false, err);
    }
    return s;
}

/* *mb = growth of the resident memory while the model is opened and makes a map on the grid, MiB.
 */
static sdm_status measure_memory(const char *path, const double *p, const sdm_grid *grid,
                                 float *values, double *mb, sdm_error *err)
{
    const sdm_generate_opts opts = {.policy = SDM_RANGE_CLAMP, .n_threads = 1};
    sdm_model *model = NULL;
    const long before = cli_bench_peak_start();
    sdm_status s = sdm_model_open(path, &model, err);
    if (!s) s = sdm_generate_grid(model, p, &opts, grid, values, NULL, NULL, err);
    *mb = cli_bench_peak_mb(before);
    sdm_model_free(model);
    return s;
}

static sdm_status measure_network(const cli_experiment_run *run, cli_experiment_job *job,
                                  const char *path, const sdm_model *model,
                                  cli_experiment_result *out, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(model);
    const uint64_t seed = run->e->experiment.seed;
    cli_eval e = {0};
    cli_timing t = {0};
    float *values = NULL;
    // includes the memory of the map
    const long before = cli_bench_peak_start();
    double more = 0;
    const cli_model_on_grid on = {model, job->maker.grid};
    const size_t voxels = sdm_grid_count(&on.grid);
    const bool own = voxels == sdm_grid_count(&info->grid);
    sdm_status s = SDM_ALLOC(&values, voxels, "distance map", err);
    if (!s) memset(values, 1, voxels * sizeof *values);
    const double map_mb = cli_bench_peak_mb(before);
    if (!s) s = measure_memory(path, job->nominal, &on.grid, values, &more, err);
    // times and errors
    job->maker = own ? cli_maker_of_model(model, job->shape) : cli_maker_on_grid(&on, job->shape);
    if (own) {
        if (!s) s = cli_time_maps(model, NULL, seed, false, 0, &t, err);
    } else {
        t.ms_batch = NAN;
        if (!s) s = cli_time_maker(&job->maker, seed, values, &t.ms_network, err);
    }
    if (!s) s = cli_evaluate_maps(&job->maker, seed, (size_t)out->row->samples, true, &e, err);
    if (!s) {
        cli_experiment_set_errors(out, &e);
        out->figure[SDM_FIGURE_MS] = t.ms_network;
        out->figure[SDM_FIGURE_MS_BATCH] = t.ms_batch;
        // 0 when the budget is a number of steps
        if (info->train_seconds > 0) out->figure[SDM_FIGURE_TRAIN] = info->train_seconds;
        out->figure[SDM_FIGURE_MODEL] = (double)info->file_bytes / MB;
        out->figure[SDM_FIGURE_PEAK] = MB_OF_MIB * (map_mb + more);
        snprintf(out->note, sizeof out->note,
                 "network %s, %s, %lld maps used in training, seed %llu%s", info->kind, out->grid,
                 (long long)info->train_samples, (unsigned long long)info->seed,
                 out->loaded ? "; loaded" : "");
        s = cli_experiment_draw(run, job, values, err);
    }
    cli_eval_dispose(&e);
    sdm_free(values);
    return s;
}

sdm_status cli_experiment_network(const cli_experiment_run *run, cli_experiment_job *job,
                                  cli_experiment_result *out, sdm_error *err)
{
    char path[SDM_PATH_TEXT_MAX];
    sdm_model *model = NULL;
    sdm_status s =
        cli_experiment_path(run, run->e->rows[job->index].network_row, "model.sdm", path, err);
    if (!s) s = cli_experiment_provide_model(run, job, out, err);
    if (!s) s = sdm_model_open(path, &model, err);
    if (!s) s = measure_network(run, job, path, model, out, err);
    sdm_model_free(model);
    return s;
}
