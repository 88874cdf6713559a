/* Time, budget, threads and reports of a run. */
#include "progress.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "sdm/internal/clock.h"
#include "sdm/internal/file.h"
#include "sdm/internal/text.h"

double trainer_seconds(const trainer *t) { return sdm_clock() - t->started; }

double trainer_shared_seconds(const trainer *t)
{
    double seconds = trainer_seconds(t);
    sdm_comm_broadcast(t->hooks.comm, 0, &seconds, sizeof seconds, NULL);
    return seconds;
}

double trainer_budget_seconds(const trainer *t)
{
    return (t->config->network.fine ? 0.9 : 1) * 60 * t->config->train.minutes;
}

bool trainer_by_time(const trainer *t) { return t->config->train.minutes > 0; }

int64_t trainer_steps(const trainer *t)
{
    const sdm_config *c = t->config;
    return c->train.steps > 0 ? c->train.steps
                              : (c->train.samples + c->train.batch - 1) / c->train.batch;
}

double trainer_fraction(const trainer *t)
{
    if (trainer_by_time(t)) return trainer_seconds(t) / (t->config->train.minutes * 60);
    return (double)t->step / (double)trainer_steps(t);
}

double trainer_start_fraction(const trainer *t)
{
    return trainer_by_time(t) ? trainer_fraction(t) : 0;
}

void trainer_enter(trainer *t, sdm_phase phase)
{
    t->phase = phase;
    t->phase_step = 0;
    t->phase_started = trainer_shared_seconds(t);
}

int trainer_workers(const trainer *t)
{
    if (t->config->data.workers > 0) return t->config->data.workers;
    return t->n_threads > 1 ? t->n_threads / 2 : 1;
}

int trainer_threads(const trainer *t)
{
    if (!t->producer) return t->n_threads;
    const int workers = trainer_workers(t);
    return workers < t->n_threads ? t->n_threads - workers : 1;
}

void trainer_pace_start(trainer *t, double unit_maps)
{
    const double now = trainer_seconds(t);
    t->pace = (trainer_pace){.unit_maps = unit_maps, .seconds = {now, now}};
}

/* Returns the units of work finished per second, over the last two to four seconds; NaN: none yet.
 * A step may take longer than that: until it ends, the rate is that of a longer time, never 0. Maps
 * that are taken from the trials of `auto` come first: the first quarter of a second of maps tells
 * nothing. */
static double pace_rate(trainer_pace *p, sdm_phase phase, double now)
{
    static const double LENGTH = 2, MAPS = 0.25;
    if (now - p->seconds[1] > LENGTH && p->done > p->before[1]) {
        p->before[0] = p->before[1], p->seconds[0] = p->seconds[1];
        p->before[1] = p->done, p->seconds[1] = now;
    }
    const double length = now - p->seconds[0];
    if (!(length > (phase == SDM_PHASE_DATA ? MAPS : 0)) || p->done <= p->before[0]) return NAN;
    return (double)(p->done - p->before[0]) / length;
}

/* Time that the rest of the budget takes, s: with a budget of steps at the pace of the last
 * seconds. */
static double seconds_left(const trainer *t, double now, double rate)
{
    if (trainer_by_time(t)) return fmax(0, t->config->train.minutes * 60 - now);
    if (t->phase == SDM_PHASE_EVALUATE) return 0;
    if (t->phase != SDM_PHASE_MODE_FIT && t->phase != SDM_PHASE_REFINE) return NAN;
    return (double)(trainer_steps(t) - t->step) / rate;
}

void trainer_report(trainer *t, double fraction, bool now)
{
    const double seconds = trainer_seconds(t);
    if (!t->hooks.progress || (!now && seconds - t->last_report < 0.1)) return;
    t->last_report = seconds;
    const double rate = pace_rate(&t->pace, t->phase, seconds);
    const dataset *d = &t->data;
    // while maps are computed the held-out ones come first
    const int64_t computed = t->pace.done - (int64_t)d->n_holdout;
    const sdm_progress p = {.phase = t->phase,
                            .fraction = fraction < 1 ? fraction : 1,
                            .step = t->step,
                            .samples = t->phase != SDM_PHASE_DATA
                                           ? (int64_t)(d->n_static + d->n_taken)
                                       : computed > 0 ? computed
                                                      : 0,
                            .samples_at_start = (int64_t)(d->n_static + d->n_start),
                            .loss = t->loss,
                            .heldout_rmse_mm = sqrt(t->heldout_mse),
                            .heldout_seconds = isfinite(t->heldout_mse) ? t->last_evaluation : NAN,
                            .samples_per_second = rate * t->pace.unit_maps,
                            .seconds = seconds,
                            .seconds_left = seconds_left(t, seconds, rate)};
    t->hooks.progress(t->hooks.user, &p);
}

void trainer_message(const trainer *t, const char *fmt, ...)
{
    char line[1024];
    va_list args;
    va_start(args, fmt);
    vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    if (t->hooks.message) t->hooks.message(t->hooks.user, line);
}

void trainer_warn(const trainer *t, const char *fmt, ...)
{
    char line[1024];
    va_list args;
    va_start(args, fmt);
    vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    if (t->hooks.warning)
        t->hooks.warning(t->hooks.user, line);
    else
        trainer_message(t, "%s", line);
}

bool trainer_cancelled(const trainer *t)
{
    return (t->hooks.cancelled && t->hooks.cancelled(t->hooks.user)) ||
           sdm_comm_broken(t->hooks.comm);
}

bool trainer_all_cancelled(const trainer *t)
{
    bool cancelled = trainer_cancelled(t);
    return sdm_comm_broadcast(t->hooks.comm, 0, &cancelled, sizeof cancelled, NULL) || cancelled;
}

bool trainer_writes(const trainer *t) { return sdm_comm_rank(t->hooks.comm) == 0; }

bool trainer_evaluation_counts(const trainer *t)
{
    enum { EVERY = 500 };
    return trainer_by_time(t) || t->phase_step % EVERY == 0;
}

bool trainer_evaluation_due(const trainer *t, double now)
{
    static const int64_t FIRST[] = {10, 20, 50, 100, 200};
    if (trainer_by_time(t)) {
        const double interval =
            fmax(1, fmax(0.5 * (now - t->phase_started), 20 * t->evaluation_seconds));
        return now - t->last_evaluation >= fmin(t->config->train.evaluate_seconds, interval);
    }
    for (size_t i = 0; i < sizeof FIRST / sizeof *FIRST; i++)
        if (t->phase_step == FIRST[i]) return true;
    return trainer_evaluation_counts(t);
}

void trainer_evaluated(trainer *t, double mse, double began)
{
    t->heldout_mse = mse;
    t->last_evaluation = trainer_shared_seconds(t);
    t->evaluation_seconds = t->last_evaluation - began;
    t->evaluated_step = t->step;
}

/* Rewrites the whole file metrics.jsonl: so it is complete at any moment, and a resumed run does
 * not repeat lines. */
sdm_status trainer_metrics_write(const trainer *t, sdm_error *err)
{
    if (!t->folder || !trainer_writes(t)) return SDM_OK; // no folder: a trial
    char path[SDM_PATH_TEXT_MAX + 32];
    snprintf(path, sizeof path, "%s/metrics.jsonl", t->folder);
    sdm_outfile *f;
    sdm_status s = sdm_outfile_open(path, &f, err);
    if (s) return s;
    s = sdm_outfile_write(f, t->metrics->data ? t->metrics->data : "", t->metrics->size, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}

/* Closes the object *j, adds it as a line and writes the file. During a training a file that cannot
 * be written is no error: the next line brings it up to date. */
static sdm_status metrics_add(trainer *t, sdm_json *j, sdm_error *err)
{
    sdm_error reason = {0};
    sdm_json_close(j, '}');
    if (!j->text.failed) sdm_text_add(t->metrics, "%s\n", j->text.data);
    const bool failed = j->text.failed || t->metrics->failed;
    sdm_json_dispose(j);
    if (failed) return sdm_fail(err, SDM_E_NOMEM, "no memory for the metrics");
    if (t->phase == SDM_PHASE_EVALUATE) return trainer_metrics_write(t, err);
    if (trainer_metrics_write(t, &reason))
        trainer_warn(t, "no line in metrics.jsonl, the next one brings it: %s", reason.text);
    return SDM_OK;
}

sdm_status trainer_metric(trainer *t, double rate, sdm_error *err)
{
    static const char *const phases[] = {"data", "bases", "fit", "refine", "evaluate"};
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", phases[t->phase]);
    sdm_json_int(&j, "step", t->step);
    sdm_json_int(&j, "maps", (int64_t)(t->data.n_static + t->data.n_taken));
    // the last phase trains nothing
    sdm_json_real(&j, "loss_mm2", t->phase == SDM_PHASE_EVALUATE ? NAN : t->loss);
    sdm_json_real(&j, "heldout_mse_mm2", t->heldout_mse);
    sdm_json_real(&j, "learning_rate", rate);
    // with a budget of steps the file has the same bits in every run: no times
    if (trainer_by_time(t)) sdm_json_real(&j, "seconds", trainer_seconds(t));
    return metrics_add(t, &j, err);
}

sdm_status trainer_metric_ranks(trainer *t, sdm_error *err)
{
    sdm_json j = {0};
    if (!t->hooks.comm) return SDM_OK;
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", "ranks");
    sdm_json_int(&j, "ranks", sdm_comm_size(t->hooks.comm));
    sdm_json_text(&j, "by", sdm_comm_name(t->hooks.comm));
    return metrics_add(t, &j, err);
}

sdm_status trainer_metric_verdict(trainer *t, const sdm_verdict *v, sdm_error *err)
{
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", "verdict");
    sdm_verdict_json(&j, v);
    if (trainer_by_time(t)) sdm_json_real(&j, "saved_seconds", v->saved_seconds);
    return metrics_add(t, &j, err);
}

void trainer_step_done(trainer *t)
{
    t->pace.done++;
    trainer_report(t, trainer_fraction(t), false);
}
