/* sdmgen fit: estimates the parameters and the pose of a shape from an image, labels, a
 * mesh or points. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cohort/cohort.h"
#include "commands.h"
#include "fit/fit_command.h"
#include "inputs/setup.h"
#include "page/page.h"
#include "report/json_values.h"
#include "report/progress_bar.h"
#include "report/terminal.h"
#include "survey/report_survey.h"

/* One progress bar for each phase. */
typedef struct progress_state {
    cli_progress bar;
    const cli_fit *f;
    sdm_fit_progress last; /* the last report, once the fit has begun */
    bool begun;
    sdm_fit_phase phase;
    size_t before; /* number of iterations before this phase */
    size_t n_fits;
    double coarse_mm;
} progress_state;

/* Share of the time of a search that its first round takes, roughly. */
#define FIRST_ROUND 0.7

/* The search: which start is tried, how many there are, and the best so far. */
static void show_search(progress_state *w, const sdm_fit_progress *p)
{
    char text[200], value[32];
    const bool first = p->round == 1;
    const double done = (double)(p->start - 1) / (double)p->n_starts,
                 fraction = first ? FIRST_ROUND * done : FIRST_ROUND + (1 - FIRST_ROUND) * done;
    size_t used =
        (size_t)snprintf(text, sizeof text, "%s %zu of %zu",
                         first ? "start" : "best starts again, finer:", p->start, p->n_starts);
    if (p->best_params) used += (size_t)snprintf(text + used, sizeof text - used, ", best so far");
    for (size_t i = 0; p->best_params && i < w->f->n_params && used + 80 < sizeof text; i++) {
        snprintf(value, sizeof value, "%.3g", p->best_params[i]);
        used += (size_t)snprintf(text + used, sizeof text - used, " %.40s=%s", w->f->params[i].name,
                                 value);
    }
    cli_progress_show(&w->bar, "search", fraction, text);
}

/* The verdict: its checks, then the rivals of the fit. */
static void show_verdict(progress_state *w, const sdm_fit_progress *p)
{
    char text[80] = "checks";
    if (p->n_starts)
        snprintf(text, sizeof text, "other poses and values: %zu of at most %zu", p->start,
                 p->n_starts);
    cli_progress_show(&w->bar, "verdict",
                      p->n_starts ? (double)(p->start - 1) / (double)p->n_starts : 0, text);
}

/* Tells why a search or iterations follow a verdict: the maps are finer now, or the fit is refused
 * and goes on from another start. */
static void tell_why_again(progress_state *w, const sdm_fit_progress *p)
{
    const cli_fit *f = w->f;
    const bool judged = w->phase == SDM_FIT_JUDGE && p->phase != SDM_FIT_JUDGE;
    char text[140];
    if (f->coarse_mm > 0 && !(w->coarse_mm > 0)) {
        snprintf(text, sizeof text, "going on with finer maps (voxels of %.2g mm)",
                 cli_fit_map_voxel(f));
        cli_progress_tell(&w->bar, "fit", text);
    } else if (judged && f->n_fits == w->n_fits) {
        const bool search = p->phase == SDM_FIT_SEARCH;
        char why[60] = "the points leave doubt";
        if (p->refused_by) snprintf(why, sizeof why, "refused by '%s'", p->refused_by);
        snprintf(text, sizeof text, "%s: %s a better pose or value of a parameter", why,
                 search ? "looking for" : "going on from");
        cli_progress_tell(&w->bar, search ? "search" : "fit", text);
    }
    w->coarse_mm = f->coarse_mm;
    w->n_fits = f->n_fits;
}

static void show_progress(void *user, const sdm_fit_progress *p)
{
    progress_state *w = user;
    const sdm_fit_opts *o = &w->f->opts;
    tell_why_again(w, p);
    w->last = *p, w->begun = true;
    // a further candidate counts from 1 again
    if (p->phase != w->phase || p->iteration <= w->before)
        w->phase = p->phase, w->before = p->iteration - 1;
    if (p->phase == SDM_FIT_SEARCH && p->n_starts) {
        show_search(w, p);
        return;
    }
    if (p->phase == SDM_FIT_JUDGE) {
        show_verdict(w, p);
        return;
    }
    char text[140] = "";
    if (w->f->candidate)
        snprintf(text, sizeof text, "candidate %zu of %zu, ", w->f->candidate, w->f->n_candidates);
    if (w->f->at_mirror) strcat(text, "mirror image, ");
    const size_t used = strlen(text), n = p->iteration - w->before,
                 most = 2 * (p->phase == SDM_FIT_POLISH && o->max_polish_iterations
                                 ? o->max_polish_iterations
                                 : o->max_iterations);
    // a fit that goes on from another pose or value may need more
    char limit[40] = "";
    if (n <= most) snprintf(limit, sizeof limit, " of at most %zu", most);
    snprintf(text + used, sizeof text - used, "iteration %zu%s, last step %.1e", n, limit, p->step);
    cli_progress_show(&w->bar,
                      p->phase == SDM_FIT_POLISH ? "polish"
                      : p->phase == SDM_FIT_MAIN ? "fit"
                                                 : "search",
                      fmin((double)n / (double)most, 1), text);
}

/* The error of a fit that an interrupt has stopped: in which phase, and that there is no result. */
static sdm_status tell_stop(const progress_state *w, sdm_error *err)
{
    const cli_fit *f = w->f;
    const sdm_fit_progress *p = &w->last;
    char phase[80], which[80] = "";
    if (!w->begun)
        snprintf(phase, sizeof phase, "before its first iteration");
    else if (p->phase == SDM_FIT_JUDGE)
        snprintf(phase, sizeof phase, "in its checks");
    else if (p->phase == SDM_FIT_SEARCH && p->n_starts)
        snprintf(phase, sizeof phase, "in the search, at start %zu of %zu", p->start, p->n_starts);
    else
        snprintf(phase, sizeof phase, "in the %s, after iteration %zu",
                 p->phase == SDM_FIT_POLISH   ? "polish"
                 : p->phase == SDM_FIT_SEARCH ? "search"
                                              : "fit",
                 p->iteration);
    if (f->candidate)
        snprintf(which, sizeof which, " of candidate %zu of %zu", f->candidate, f->n_candidates);
    else if (f->at_mirror)
        snprintf(which, sizeof which, " of the mirror image");
    else if (f->coarse_mm > 0)
        snprintf(which, sizeof which, " with finer maps");
    return sdm_fail(err, SDM_E_CANCELLED,
                    "%s: the fit%s was stopped on request %s; no file was written", f->path, which,
                    phase);
}

static sdm_status check_arguments(cli_fit *f, sdm_error *err)
{
    const cli_args *args = f->args;
    const bool with_model = args->files.n == 2;
    if (!args->files.n)
        return sdm_fail(err, SDM_E_ARG, "usage: sdmgen fit %s", args->command->synopsis);
    if (args->part || args->cohort.claim)
        return sdm_fail(err, SDM_E_ARG, "fit: --%s belongs to --cases TABLE",
                        args->part ? "part" : "claim");
    if (with_model && args->shape)
        return sdm_fail(err, SDM_E_ARG,
                        "fit: either MODEL or --shape NAME, not both (files: '%s', '%s')",
                        args->files.items[0], args->files.items[1]);
    if (!with_model && !args->shape)
        return sdm_fail(err, SDM_E_ARG,
                        "fit: a MODEL and an IMAGE are needed, or --shape NAME and an IMAGE");
    f->model_path = with_model ? args->files.items[0] : NULL;
    f->path = args->files.items[with_model];
    if (args->report && !with_model)
        return sdm_fail(err, SDM_E_ARG, "fit: --report needs a MODEL: a page runs its network");
    const sdm_status s = cli_page_check_option(args, err);
    return s ? s : cli_fit_check_files(args, err);
}

/* Runs the fit. Returns SDM_OK also for a fit that is not trustworthy (f->doubt): its result is
 * shown before the command fails. */
static sdm_status fit_shape(cli_fit *f, sdm_error *err)
{
    progress_state w = {.f = f};
    f->opts.progress = show_progress;
    f->opts.cancelled = cli_interrupted;
    f->opts.user = &w;
    cli_progress_start(&w.bar);
    if (f->args->fit.find) cli_progress_show(&w.bar, "search", 0, "the whole image");
    sdm_status s = f->args->fit.find ? cli_fit_find(f, err) : cli_fit_run(f, err);
    if (!s && !f->args->fit.find) s = cli_fit_go_finer(f, err);
    cli_progress_end(&w.bar, !s && (!f->doubt.status || f->doubt.status == SDM_E_QUALITY));
    f->found = f->result.objective && f->result.params;
    cli_fit_doubt_changed_shape(f);
    for (size_t i = 0; i < f->result.verdict.n_findings; i++)
        cli_name_options(f->result.verdict.findings[i].text);
    if (s == SDM_E_CANCELLED || f->doubt.status == SDM_E_CANCELLED) return tell_stop(&w, err);
    if (s || !f->doubt.status || f->doubt.status == SDM_E_QUALITY) return s;
    char astray[400] = "";
    if (f->doubt.status == SDM_E_ARG) (void)cli_fit_astray(f, astray, sizeof astray, NULL);
    return sdm_fail(err, f->doubt.status, "%s: %s%s", f->path, f->doubt.text, astray);
}

static void print_notices(const cli_fit *f)
{
    const sdm_fit_result *r = &f->result;
    if (*f->side && f->other_side && !f->n_candidates)
        cli_notice("%s=%s fits better than its mirror image, by %.3g (log-likelihood); -O %s=... "
                   "states the side",
                   f->mirror, f->side, f->better, f->mirror);
    if (r->start_clamped && !f->start_clamped)
        cli_notice("the start parameters were clamped to their range");
    if (r->n_exact_outside)
        cli_notice("%zu maps outside of the trained range were made by the exact engine",
                   r->n_exact_outside);
    if (f->opts.cavity > 0 && !r->n_cavity)
        cli_notice("--cavity %g left nothing out: the widest space like the inside holds a ball of "
                   "%.3g mm",
                   f->opts.cavity, r->widest_space);
    if (r->n_nan)
        cli_notice("%zu voxels are NaN%s and were ignored", r->n_nan,
                   r->n_cavity ? " or in wide spaces (--cavity)" : "");
}

static sdm_status print_result(const cli_fit *f, sdm_error *err)
{
    if (!f->args->json) {
        cli_fit_print(f);
        return SDM_OK;
    }
    sdm_json json = {0};
    cli_fit_json(f, &json);
    return cli_print_json(&json, err);
}

static sdm_status write_json(const cli_fit *f, const char *path, sdm_error *err)
{
    sdm_json json = {0};
    if (!path) return SDM_OK;
    cli_fit_json(f, &json);
    const sdm_status s = cli_json_write(&json, path, err);
    sdm_json_dispose(&json);
    return s;
}

static sdm_status write_page(const cli_fit *f, sdm_error *err)
{
    sdm_json json = {0};
    cli_fit_json(f, &json);
    const sdm_status s = cli_page_report_fit(f->args, &json, f->args->report, err);
    sdm_json_dispose(&json);
    return s;
}

/* Prints the result and writes the files; if the fit is not trustworthy, fails with the reason. */
static sdm_status show_result(cli_fit *f, const char *json, sdm_error *err)
{
    const bool files = f->args->outputs.n || f->args->fit.label_out,
               write = !f->doubt.status || f->args->force;
    char text[640];
    sdm_status s = SDM_OK, measured = SDM_OK;
    if (f->found) {
        print_notices(f);
        measured = cli_fit_measure(f, err); // the result is shown without measures, too
        s = cli_fit_make_map(f, err);
        if (!s) s = cli_fit_compare(f, err);
        if (!s) s = cli_fit_compare_truth(f, err);
        if (!s) cli_fit_warn_mismatch(f);
        if (!s && write) s = cli_fit_write_files(f, err);
        if (!s) s = write_json(f, json, err);
        if (!s && f->args->report) s = write_page(f, err);
        if (!s) s = print_result(f, err);
        if (!s) s = cli_fit_write_results(f, err);
        if (!s) s = measured;
    }
    if (s || !f->doubt.status) return s;
    return sdm_fail(err, f->doubt.status, "%s: %s%s%s", f->path, f->doubt.text,
                    cli_fit_remedy(f, text, sizeof text),
                    files && f->found && !write ? "; no file was written (--force writes them)"
                                                : "");
}

/* Runs one fit. json: file for the results also of a fit that is not trustworthy; NULL: none. */
static sdm_status fit_one(const cli_args *args, const char *json, sdm_error *err)
{
    cli_fit f = {.args = args};
    sdm_status s = check_arguments(&f, err);
    if (!s) s = cli_fit_open_source(&f, err);
    if (!s) s = cli_fit_check_mirror(&f, err);
    if (!s) s = cli_fit_prepare_measures(&f, err);
    if (!s) s = cli_fit_read_options(&f, err);
    if (!s) s = cli_fit_read_target(&f, err);
    if (!s) s = cli_fit_check_options(&f, err);
    if (!s) s = cli_fit_make_grid(&f, err);
    if (!s) cli_fit_default_lengths(&f);
    if (!s) s = cli_fit_read_reference(&f, err);
    if (!s) s = cli_fit_read_truth(&f, err);
    if (!s) s = cli_fit_read_start(&f, err);
    if (!s) s = cli_fit_check_size(&f, err);
    if (!s) cli_fit_notice_tissues(&f);
    if (!s) cli_fit_notice_kept(&f);
    // of many cases each has a process of its own: the test of one is enough, which users make
    // first
    if (!s && f.shape && !args->cohort.cases && cli_other_process(args, f.registry, f.shape).plugin)
        cli_warn_repeats(f.shape);
    if (!s) s = cli_fit_check_contrast(&f, err);
    if (!s) s = fit_shape(&f, err);
    if (!s) s = cli_fit_explain_contrast(&f, err);
    if (!s) s = show_result(&f, json, err);
    cli_fit_dispose(&f);
    return s;
}

sdm_status cmd_fit(const cli_args *args, sdm_error *err)
{
    return args->cohort.cases ? cli_cohort_run(args, fit_one, err) : fit_one(args, NULL, err);
}
