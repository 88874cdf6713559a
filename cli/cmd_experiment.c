/* sdmgen experiment: methods side by side, trained, measured and drawn; one table beside the
 * figures of others. */
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

static sdm_status print_keys(bool markdown, sdm_error *err)
{
    sdm_text text = {0};
    sdm_experiment_describe(markdown, &text);
    const sdm_status s =
        text.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the list of keys") : SDM_OK;
    if (!s) fputs(text.data, stdout);
    sdm_text_dispose(&text);
    return s;
}

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
        if (*m->engine) s = experiment_check_engine(m->engine, err);
        if (s) s = sdm_fail_in(err, s, "%s:%d:%d", (*out)->file, m->mark.line, m->mark.column);
    }
    sdm_error picture = {0};
    if (!s && (*out)->experiment.pictures && sdm_picture_check("slices.png", &picture)) {
        cli_notice("%s", picture.text);
        (*out)->experiment.pictures = false;
    }
    return s;
}

/* The row that the speed-up refers to: the baseline's in the same variant. */
static const experiment_result *find_baseline(const experiment_run *run, const experiment_result *r)
{
    for (size_t i = 0; i < run->e->n_rows; i++)
        if (run->e->rows[i].variant == r->row->variant &&
            !strcmp(run->e->rows[i].method->name, run->e->experiment.baseline))
            return &run->results[i];
    return NULL;
}

static void find_speedups(const experiment_run *run)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        experiment_result *r = &run->results[i];
        const experiment_result *base = find_baseline(run, r);
        const sdm_figure time = r->row->method->fit ? SDM_FIGURE_FIT : SDM_FIGURE_MS;
        if (base) r->figure[SDM_FIGURE_SPEEDUP] = base->figure[time] / r->figure[time];
    }
}

/* A row that fails has its reason in the table; only an interrupt ends the others. */
static sdm_status do_row(const experiment_run *run, size_t index, sdm_error *err)
{
    experiment_result *r = &run->results[index];
    experiment_job *job = &run->jobs[index];
    sdm_status s = job->why.status;
    if (s)
        *err = job->why;
    else if (r->row->method->fit)
        s = experiment_fit_row(run, job, r, err);
    else if (*r->row->method->engine)
        s = experiment_engine(run, job, r, err);
    else
        s = experiment_network(run, job, r, err);
    experiment_job_close(job);
    if (!s || s == SDM_E_CANCELLED) {
        if (!s) r->state = EXPERIMENT_DONE;
        return s;
    }
    r->state = s == SDM_E_UNSUPPORTED ? EXPERIMENT_MISSING : EXPERIMENT_FAILED;
    for (int f = 0; f < SDM_N_FIGURES; f++) r->figure[f] = NAN;
    snprintf(r->note, sizeof r->note, "%.*s", (int)strcspn(err->text, "\n"), err->text);
    experiment_log(run, "%s: %s: %s", r->row->title,
                   s == SDM_E_UNSUPPORTED ? "not available" : "failed", r->note);
    return s;
}

/* What went wrong first, after all rows. */
static sdm_status sum_up(const experiment_run *run, sdm_status first, size_t failed,
                         const sdm_error *why, sdm_error *err)
{
    if (first == SDM_E_CANCELLED)
        return sdm_fail(err, first, "interrupted; the same command%s goes on where it stopped (%s)",
                        run->args->force ? " without --force" : "", run->folder);
    if (failed == 0) return SDM_OK;
    return sdm_fail(err, first, "%zu of %zu rows failed; the first: %.*s", failed, run->e->n_rows,
                    (int)strcspn(why->text, "\n"), why->text);
}

/* An interrupted run leaves the tables of an earlier one as they are: its own have rows that were
 * not done. */
static bool keeps_tables(const experiment_run *run, sdm_status first)
{
    char path[SDM_PATH_TEXT_MAX + 16];
    snprintf(path, sizeof path, "%s/table.json", run->folder);
    return first == SDM_E_CANCELLED && !access(path, F_OK);
}

static sdm_status run_rows(const experiment_run *run, sdm_error *err)
{
    sdm_error why = {0};
    sdm_status first = SDM_OK;
    size_t failed = 0;
    experiment_log_start(run);
    for (size_t i = 0; i < run->e->n_rows && first != SDM_E_CANCELLED; i++) {
        sdm_error one = {0};
        const sdm_status s = do_row(run, i, &one);
        if (!s || s == SDM_E_UNSUPPORTED) continue;
        failed++;
        if (failed > 1 && s != SDM_E_CANCELLED) continue;
        first = s;
        why = one;
    }
    experiment_fit_finish(run);
    find_speedups(run);
    sdm_text markdown = {0};
    sdm_json json = {0};
    sdm_status s =
        keeps_tables(run, first) ? SDM_OK : experiment_write_tables(run, &markdown, &json, err);
    if (!s && first != SDM_E_CANCELLED) {
        if (run->args->json)
            puts(json.text.data);
        else
            fputs(markdown.data, stdout);
        experiment_log(run, "done; table.md, table.csv, table.json in %s", run->folder);
    }
    sdm_text_dispose(&markdown);
    sdm_json_dispose(&json);
    return s ? s : sum_up(run, first, failed, &why, err);
}

/* Shapes, options and ranges that cannot be are told before anything is done; what else is wrong
 * with a row is its own affair. */
static sdm_status open_rows(const experiment_run *run, sdm_error *err)
{
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const sdm_status s = experiment_job_open(run, i, &run->jobs[i]);
        if (s != SDM_E_CONFIG) continue;
        if (err) *err = run->jobs[i].why;
        return s;
    }
    return SDM_OK;
}

static sdm_status run_experiment(const cli_args *args, const sdm_experiment *e,
                                 const sdm_registry *registry, sdm_error *err)
{
    experiment_run run = {.args = args, .e = e, .registry = registry, .start = sdm_clock()};
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
    if (!s) s = args->dry_run ? experiment_print_plan(&run, err) : run_rows(&run, err);
    for (size_t i = 0; run.results && i < e->n_rows; i++) experiment_fits_free(run.results[i].fits);
    for (size_t i = 0; run.jobs && i < e->n_rows; i++) experiment_job_close(&run.jobs[i]);
    sdm_free(run.jobs);
    sdm_free(run.results);
    return s;
}

sdm_status cmd_experiment(const cli_args *args, sdm_error *err)
{
    sdm_experiment *e = NULL;
    sdm_registry *registry = NULL;
    if (args->keys && args->files.n > 0)
        return sdm_fail(err, SDM_E_ARG, "experiment: --keys stands alone");
    if (args->keys) return print_keys(args->markdown, err);
    sdm_status s = read_experiment(args, &e, err);
    if (!s) s = cli_open_registry(args, &registry, err);
    if (!s) s = run_experiment(args, e, registry, err);
    sdm_registry_free(registry);
    sdm_experiment_free(e);
    return s;
}
