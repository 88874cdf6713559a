/* sdmgen experiment: trains, measures and draws several methods, and writes one table that
 * compares them with each other and with published figures. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "commands.h"
#include "inputs/setup.h"
#include "report/terminal.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"
#include "sdm/picture.h"
#include "study/experiment_fit.h"
#include "study/experiment_fit_table.h"

static sdm_status read_experiment(const cli_args *args, sdm_experiment **out, sdm_error *err)
{
    if (args->files.n == 0)
        return sdm_fail(err, SDM_E_ARG, "usage: sdmgen experiment CONFIG [key=value ...]");
    for (size_t i = 1; i < args->files.n; i++)
        if (!strchr(args->files.items[i], '='))
            return sdm_fail(err, SDM_E_ARG, "unexpected argument '%.200s', need key=value",
                            args->files.items[i]);
    sdm_status s = sdm_experiment_read(args->files.items[0], args->files.items + 1,
                                       args->files.n - 1, out, err);
    for (size_t i = 0; !s && i < (*out)->n_methods; i++) {
        const sdm_experiment_method *m = &(*out)->methods[i];
        if (*m->engine) s = cli_experiment_check_engine(m->engine, err);
        if (s) s = sdm_fail_in(err, s, "%s:%d:%d", (*out)->file, m->mark.line, m->mark.column);
    }
    sdm_error picture = {0};
    if (!s && (*out)->experiment.pictures && sdm_picture_check("slices.png", &picture)) {
        cli_notice("%s", picture.text);
        (*out)->experiment.pictures = false;
    }
    return s;
}

/* Returns the row of the baseline method in the same variant, relative to which the speed-up is
 * given. */
static const cli_experiment_result *find_baseline(const cli_experiment_run *run,
                                                  const cli_experiment_result *r)
{
    for (size_t i = 0; i < run->e->n_rows; i++)
        if (run->e->rows[i].variant == r->row->variant &&
            !strcmp(run->e->rows[i].method->name, run->e->experiment.baseline))
            return &run->results[i];
    return NULL;
}

static void find_speedups(const cli_experiment_run *run)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        cli_experiment_result *r = &run->results[i];
        const cli_experiment_result *base = find_baseline(run, r);
        const sdm_figure time = r->row->method->fit ? SDM_FIGURE_FIT : SDM_FIGURE_MS;
        if (base) r->figure[SDM_FIGURE_SPEEDUP] = base->figure[time] / r->figure[time];
    }
}

/* Measures a row. If the measurement fails, the table shows the reason and the other rows follow;
 * only an interrupt ends the experiment. */
static sdm_status measure_row(const cli_experiment_run *run, size_t index, sdm_error *err)
{
    cli_experiment_result *r = &run->results[index];
    cli_experiment_job *job = &run->jobs[index];
    sdm_status s = job->open_error.status;
    if (s)
        *err = job->open_error;
    else if (r->row->method->fit)
        s = cli_experiment_fit_row(run, job, r, err);
    else if (*r->row->method->engine)
        s = cli_experiment_engine(run, job, r, err);
    else
        s = cli_experiment_network(run, job, r, err);
    cli_experiment_job_close(job);
    if (!s || s == SDM_E_CANCELLED) {
        if (!s) r->state = CLI_EXPERIMENT_DONE;
        return s;
    }
    r->state = s == SDM_E_UNSUPPORTED ? CLI_EXPERIMENT_MISSING : CLI_EXPERIMENT_FAILED;
    for (int f = 0; f < SDM_N_FIGURES; f++) r->figure[f] = NAN;
    snprintf(r->note, sizeof r->note, "%.*s", (int)strcspn(err->text, "\n"), err->text);
    cli_experiment_log(run, "%s: %s: %s", r->row->title,
                       s == SDM_E_UNSUPPORTED ? "not available" : "failed", r->note);
    return s;
}

/* Returns the status of the experiment after all rows: that of the first failure, with the number
 * of failures in the message. */
static sdm_status summarise_failures(const cli_experiment_run *run, sdm_status first, size_t failed,
                                     const sdm_error *why, sdm_error *err)
{
    if (first == SDM_E_CANCELLED)
        return sdm_fail(err, first,
                        "interrupted; the same command%s continues where it stopped (%s)",
                        run->args->force ? " without --force" : "", run->folder);
    if (failed == 0) return SDM_OK;
    return sdm_fail(err, first, "%zu of %zu rows failed; the first: %.*s", failed, run->e->n_rows,
                    (int)strcspn(why->text, "\n"), why->text);
}

/* True when the tables of an earlier run must stay: an interrupted run has rows without results. */
static bool keeps_tables(const cli_experiment_run *run, sdm_status first)
{
    char path[SDM_PATH_TEXT_MAX + 16];
    snprintf(path, sizeof path, "%s/table.json", run->folder);
    return first == SDM_E_CANCELLED && !access(path, F_OK);
}

/* Measures all rows and writes the tables. */
static sdm_status measure_rows(const cli_experiment_run *run, sdm_error *err)
{
    sdm_error why = {0};
    sdm_status first = SDM_OK;
    size_t failed = 0;
    // the rows
    cli_experiment_log_start(run);
    for (size_t i = 0; i < run->e->n_rows && first != SDM_E_CANCELLED; i++) {
        sdm_error one = {0};
        const sdm_status s = measure_row(run, i, &one);
        if (!s || s == SDM_E_UNSUPPORTED) continue;
        failed++;
        if (failed > 1 && s != SDM_E_CANCELLED) continue;
        first = s;
        why = one;
    }
    // compute the figures that need several rows
    cli_experiment_fit_finish(run);
    find_speedups(run);
    // the tables
    sdm_text markdown = {0};
    sdm_json json = {0};
    sdm_status s =
        keeps_tables(run, first) ? SDM_OK : cli_experiment_write_tables(run, &markdown, &json, err);
    if (!s && first != SDM_E_CANCELLED) {
        if (run->args->json)
            puts(json.text.data);
        else
            fputs(markdown.data, stdout);
        cli_experiment_log(run, "done; table.md, table.csv, table.json in %s", run->folder);
    }
    sdm_text_dispose(&markdown);
    sdm_json_dispose(&json);
    return s ? s : summarise_failures(run, first, failed, &why, err);
}

/* Opens the jobs of all rows. Wrong shapes, options or ranges (SDM_E_CONFIG) end the experiment
 * before any work; other errors only fail their row. */
static sdm_status open_rows(const cli_experiment_run *run, sdm_error *err)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const sdm_status s = cli_experiment_job_open(run, i, &run->jobs[i]);
        if (s != SDM_E_CONFIG) continue;
        if (err) *err = run->jobs[i].open_error;
        return s;
    }
    return SDM_OK;
}

static sdm_status run_experiment(const cli_args *args, const sdm_experiment *e,
                                 const sdm_registry *registry, sdm_error *err)
{
    cli_experiment_run run = {.args = args, .e = e, .registry = registry, .start = sdm_clock()};
    run.folder = args->out ? args->out : e->experiment.folder;
    if (strlen(run.folder) >= SDM_PATH_TEXT_MAX)
        return sdm_fail(err, SDM_E_ARG, "--out '%.100s...': the name is too long", run.folder);
    sdm_status s = SDM_ALLOC(&run.results, e->n_rows, "results", err);
    for (size_t i = 0; i < e->n_rows && !s; i++) {
        run.results[i].row = &e->rows[i];
        for (int f = 0; f < SDM_N_FIGURES; f++) run.results[i].figure[f] = NAN;
    }
    if (!s) s = SDM_ALLOC(&run.jobs, e->n_rows, "rows", err);
    if (!s) s = open_rows(&run, err);
    if (!s && !args->dry_run) s = sdm_make_folder(run.folder, err);
    if (!s) s = args->dry_run ? cli_experiment_print_plan(&run, err) : measure_rows(&run, err);
    for (size_t i = 0; run.results && i < e->n_rows; i++)
        cli_experiment_fits_free(run.results[i].fits);
    for (size_t i = 0; run.jobs && i < e->n_rows; i++) cli_experiment_job_close(&run.jobs[i]);
    sdm_free(run.jobs);
    sdm_free(run.results);
    return s;
}

sdm_status cmd_experiment(const cli_args *args, sdm_error *err)
{
    sdm_experiment *e = NULL;
    sdm_registry *registry = NULL;
    if (args->keys && args->files.n > 0)
        return sdm_fail(err, SDM_E_ARG, "experiment: --keys stands alone, without CONFIG");
    if (args->keys) {
        sdm_text text = {0};
        sdm_experiment_describe(args->markdown, &text);
        return cli_print_text(&text, err);
    }
    sdm_status s = read_experiment(args, &e, err);
    if (!s) s = cli_open_registry(args, &registry, err);
    if (!s) s = run_experiment(args, e, registry, err);
    sdm_registry_free(registry);
    sdm_experiment_free(e);
    return s;
}
