/* Tells when a survey has to stop, counts findings, and runs a function for every shape on several
 * threads. */
#include "survey_state.h"

#include <math.h>

#include "sdm/internal/clock.h"

bool survey_is_cancelled(const survey *v)
{
    return v->opts->cancelled && v->opts->cancelled(v->opts->user);
}

/* When `part` of the time is over. */
static double end_of(const survey *v, double part)
{
    return v->opts->seconds > 0 ? v->start + part * v->opts->seconds : INFINITY;
}

bool survey_is_late(const survey *v, double part)
{
    return survey_is_cancelled(v) || sdm_clock() > end_of(v, part);
}

static bool stops(void *user)
{
    const survey_stop *stop = user;
    return survey_is_cancelled(stop->v) || sdm_clock() > stop->until;
}

void survey_stop_set(survey_stop *stop, const survey *v, double part, double least)
{
    const double until = fmax(end_of(v, part), sdm_clock() + least);
    *stop = (survey_stop){v, until, {.n_threads = v->opts->n_threads, .cancelled = stops}};
    stop->opts.user = stop;
}

void survey_count(sdm_survey_count *c, size_t shape, double amount)
{
    if (!(amount > 0)) return;
    c->shapes++;
    if (!(amount > c->amount)) return;
    c->amount = amount;
    c->worst = shape;
}

/* Reports that one more of n items is done. */
static void report(const sdm_survey_opts *opts, const char *what, size_t *done, size_t n)
{
    if (!opts->progress || !what) return;
#pragma omp critical(sdm_survey_progress)
    opts->progress(opts->user, what, (double)++*done / (double)n);
}

sdm_status survey_run(survey *v, int n_threads, const char *what, size_t n, survey_body *body,
                      sdm_error *err)
{
    sdm_status status = SDM_OK;
    size_t done = 0;
#pragma omp parallel num_threads(n_threads)
    {
        sdm_mesh mesh = {0};
        sdm_error why = {0};
#pragma omp for schedule(dynamic)
        for (size_t i = 0; i < n; i++) {
            sdm_status now;
#pragma omp atomic read
            now = status;
            if (now) continue;
            const sdm_status s = body(v, i, &mesh, &why);
            if (!s) report(v->opts, what, &done, n);
            if (!s) continue;
#pragma omp critical(sdm_survey)
            if (!status) {
                if (err) *err = why;
#pragma omp atomic write
                status = s;
            }
        }
        sdm_mesh_dispose(&mesh);
    }
    return status;
}
