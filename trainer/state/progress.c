/* Time, budget, threads and reports of a run. */
#include "progress.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

#include "sdm/internal/clock.h"
#include "sdm/internal/file.h"
#include "sdm/internal/text.h"

double trainer_seconds(const trainer *t) { return sdm_clock() - t->started; }

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
    t->phase_started = trainer_seconds(t);
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

void trainer_report(trainer *t, double fraction, double samples_per_second, bool now)
{
    const double seconds = trainer_seconds(t);
    if (!t->hooks.progress || (!now && seconds - t->last_report < 0.1)) return;
    t->last_report = seconds;
    const double all = trainer_by_time(t) ? t->config->train.minutes * 60
                       : fraction > 0     ? seconds / fraction
                                          : NAN;
    const sdm_progress p = {.phase = t->phase,
                            .fraction = fraction < 1 ? fraction : 1,
                            .step = t->step,
                            .samples = (int64_t)(t->data.n_static + t->data.n_taken),
                            .loss = t->loss,
                            .heldout_rmse_mm = sqrt(t->heldout_mse),
                            .samples_per_second = samples_per_second,
                            .seconds = seconds,
                            .seconds_left = all > seconds ? all - seconds : 0};
    t->hooks.progress(t->hooks.user, &p);
}

void trainer_message(trainer *t, const char *fmt, ...)
{
    if (!t->hooks.message) return;
    char line[1024];
    va_list args;
    va_start(args, fmt);
    vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    t->hooks.message(t->hooks.user, line);
}

bool trainer_cancelled(const trainer *t)
{
    return t->hooks.cancelled && t->hooks.cancelled(t->hooks.user);
}

bool trainer_evaluation_due(const trainer *t, double now)
{
    return trainer_by_time(t) ? now - t->last_evaluation >= t->config->train.evaluate_seconds
                              : t->phase_step % 500 == 0;
}

/* Rewrites the whole file metrics.jsonl: so it is complete at any moment, and a resumed run does
 * not repeat lines. */
static sdm_status metrics_write(const trainer *t, sdm_error *err)
{
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

sdm_status trainer_metric(trainer *t, double rate, sdm_error *err)
{
    static const char *const phases[] = {"data", "bases", "fit", "refine", "evaluate"};
    sdm_json j = {0};
    sdm_json_open(&j, NULL, '{');
    sdm_json_text(&j, "phase", phases[t->phase]);
    sdm_json_int(&j, "step", t->step);
    sdm_json_int(&j, "maps", (int64_t)(t->data.n_static + t->data.n_taken));
    sdm_json_real(&j, "loss_mm2", t->loss);
    sdm_json_real(&j, "heldout_mse_mm2", t->heldout_mse);
    sdm_json_real(&j, "learning_rate", rate);
    // with a budget of steps the file has the same bits in every run: no times
    if (trainer_by_time(t)) sdm_json_real(&j, "seconds", trainer_seconds(t));
    sdm_json_close(&j, '}');
    if (!j.text.failed) sdm_text_add(t->metrics, "%s\n", j.text.data);
    const bool failed = j.text.failed || t->metrics->failed;
    sdm_json_dispose(&j);
    return failed ? sdm_fail(err, SDM_E_NOMEM, "no memory for the metrics") : metrics_write(t, err);
}

trainer_speed trainer_speed_start(const trainer *t)
{
    return (trainer_speed){t->phase_step, trainer_seconds(t)};
}

void trainer_speed_report(trainer *t, trainer_speed *last, size_t batch, double now)
{
    if (!(now - last->seconds > 0.5)) return;
    const double maps = (double)(t->phase_step - last->step) * (double)batch;
    trainer_report(t, trainer_fraction(t), maps / (now - last->seconds), true);
    *last = (trainer_speed){t->phase_step, now};
}
