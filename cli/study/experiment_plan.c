/* Prints the plan of an experiment: the action of every row and the duration of the trainings. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "experiment_command.h"
#include "report/terminal.h"

/* The planned action of a row and the budget of its training. */
typedef struct plan {
    const char *action;
    double minutes;  /* 0: no training, or a budget of steps or samples */
    char budget[64]; /* "5 min", "2000 steps"; "": no training */
} plan;

static plan plan_row(const cli_experiment_run *run, const cli_experiment_job *job)
{
    const sdm_config *c = job->config;
    plan p = {.action = "measure"};
    const sdm_experiment_method *m = run->e->rows[job->index].method;
    // rows without a network of their own
    if (m->fit) p.action = m->fit == SDM_EXPERIMENT_FIT_NAIVE ? "time a map" : "fit";
    if (*m->engine || m->fit == SDM_EXPERIMENT_FIT_POLISH) return p;
    if (m->fit && *run->e->fit.model) {
        p.action = "load, fit";
        return p;
    }
    // rows with a network
    if (run->e->rows[job->index].network_row != job->index) {
        p.action = m->fit ? "load, fit" : "load, measure";
        return p;
    }
    switch (cli_experiment_find_stored(run, job)) {
    case CLI_STORED_MODEL:
        p.action = m->fit ? "load, fit" : "load, measure";
        return p;
    case CLI_STORED_CHECKPOINT:
        p.action = m->fit ? "go on training, fit" : "go on training, measure";
        break;
    case CLI_STORED_OTHER:
        p.action = m->fit ? "train anew, fit" : "train anew, measure";
        break;
    default:
        p.action = m->fit ? "train, fit" : "train, measure";
    }
    // the budget of the training
    p.minutes = c->train.minutes;
    if (c->train.minutes > 0)
        snprintf(p.budget, sizeof p.budget, "%g min", c->train.minutes);
    else if (c->train.steps > 0)
        snprintf(p.budget, sizeof p.budget, "%lld steps", (long long)c->train.steps);
    else
        snprintf(p.budget, sizeof p.budget, "%lld samples", (long long)c->train.samples);
    return p;
}

static void add_row(const cli_experiment_run *run, const cli_experiment_job *job, const plan *p,
                    int width, sdm_json *j)
{
    const sdm_experiment_row *row = &run->e->rows[job->index];
    const long long samples = row->method->fit ? run->e->fit.phantoms : row->samples;
    const char *what = *row->method->engine ? row->method->engine : row->method->network;
    if (run->args->json) {
        sdm_json_open(j, NULL, '{');
        sdm_json_text(j, "method", row->title);
        sdm_json_text(j, *row->method->engine ? "engine" : "network", what);
        sdm_json_text(j, "grid", run->results[job->index].grid);
        sdm_json_text(j, "action", p->action);
        sdm_json_real(j, "minutes", p->minutes);
        sdm_json_text(j, "budget", p->budget);
        sdm_json_int(j, row->method->fit ? "phantoms" : "samples", samples);
        sdm_json_text(j, "folder", job->config->output.folder);
        sdm_json_close(j, '}');
    } else {
        printf("%-*s %-8s %-34s %-24s %-12s %s %-5lld %s\n", width, row->title, what,
               run->results[job->index].grid, p->action, p->budget,
               row->method->fit ? "phantoms" : "samples", samples, job->config->output.folder);
    }
}

sdm_status cli_experiment_print_plan(const cli_experiment_run *run, sdm_error *err)
{
    sdm_json j = {0};
    double minutes = 0;
    size_t untimed = 0;
    int width = 28;
    sdm_status s = SDM_OK;
    // width of the titles
    for (size_t i = 0; i < run->e->n_rows; i++) {
        const int length = (int)strlen(run->e->rows[i].title);
        if (length > width) width = length;
    }
    // the rows
    sdm_json_open(&j, NULL, '{');
    sdm_json_open(&j, "rows", '[');
    for (size_t i = 0; i < run->e->n_rows && !s; i++) {
        const cli_experiment_job *job = &run->jobs[i];
        if ((s = job->open_error.status)) {
            if (err) *err = job->open_error;
            break;
        }
        const plan p = plan_row(run, job);
        minutes += p.minutes;
        untimed += *p.budget && !(p.minutes > 0);
        add_row(run, job, &p, width, &j);
    }
    // the sum
    sdm_json_close(&j, ']');
    sdm_json_real(&j, "minutes", minutes);
    sdm_json_real(&j, "limit", run->e->experiment.minutes);
    sdm_json_close(&j, '}');
    if (!s && run->args->json) return cli_print_json(&j, err);
    sdm_json_dispose(&j);
    if (s) return s;
    printf("\ntrainings: %g min in total", minutes);
    if (untimed) printf(", and %zu by steps or samples, of unknown duration", untimed);
    if (run->e->experiment.minutes > 0) printf("; limit %g min", run->e->experiment.minutes);
    printf("; results in %s\n", run->folder);
    return SDM_OK;
}
