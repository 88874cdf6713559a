/* Shows the progress of a training (step, loss, error, time left, speed) and prints its notices and
   warnings. */
#include "train_progress.h"

#include <math.h>
#include <stdio.h>

#include "terminal.h"

static const char *phase_name(sdm_phase phase)
{
    switch (phase) {
    case SDM_PHASE_TRIAL:
        return "trial";
    case SDM_PHASE_DATA:
        return "data";
    case SDM_PHASE_BASES:
        return "bases";
    case SDM_PHASE_MODE_FIT:
        return "fit";
    case SDM_PHASE_REFINE:
        return "refine";
    default:
        return "evaluate";
    }
}

/* Formats a time as "1:05" or "2:01:30"; "-:--" when the time is unknown. */
static void format_time(char *buf, size_t size, double seconds)
{
    if (!(seconds >= 0) || seconds > 1e8)
        snprintf(buf, size, "-:--");
    else if (seconds < 3600)
        snprintf(buf, size, "%d:%02d", (int)seconds / 60, (int)seconds % 60);
    else
        snprintf(buf, size, "%d:%02d:%02d", (int)seconds / 3600, (int)seconds / 60 % 60,
                 (int)seconds % 60);
}

/* Formats a rate as "0.31", "8.5", "850", "18k" or "2.1M"; "-" when it is unknown. */
static void format_rate(char buf[32], double rate)
{
    if (!isfinite(rate))
        snprintf(buf, 32, "-");
    else if (rate < 9.95)
        snprintf(buf, 32, "%.2g", rate);
    else if (rate < 9999.5)
        snprintf(buf, 32, "%.0f", rate);
    else if (rate < 999.5e3)
        snprintf(buf, 32, "%.0fk", rate / 1e3);
    else
        snprintf(buf, 32, "%.1fM", rate / 1e6);
}

/* "1:53 left  1,250 of 8,177 exact maps  61 maps/s"; the number of maps is not known at first */
static void format_maps(const sdm_progress *p, char *text, size_t size)
{
    char done[32], all[32], rate[32], left[32];
    format_rate(rate, p->samples_per_second);
    format_time(left, sizeof left, p->seconds_left);
    if (p->samples_at_start > 0)
        snprintf(text, size, "%s left  %s of %s exact maps  %s maps/s", left,
                 cli_format_count(p->samples, done), cli_format_count(p->samples_at_start, all),
                 rate);
    else
        snprintf(text, size, "%s left", left);
}

/* "1:05 left  held-out 0.0123 mm (12 s ago)  18k maps/s  loss 3.1e-05 mm^2  step 1,200"; what
   counts most comes first, for narrow terminals. */
static void format_steps(const sdm_progress *p, char *text, size_t size)
{
    char step[32], loss[32] = "-", error[64] = "-", left[32], rate[32];
    if (isfinite(p->loss)) snprintf(loss, sizeof loss, "%.1e mm^2", p->loss);
    if (isfinite(p->heldout_rmse_mm))
        snprintf(error, sizeof error, "%.4f mm (%.0f s ago)", p->heldout_rmse_mm,
                 fmax(0, p->seconds - p->heldout_seconds));
    format_rate(rate, p->samples_per_second);
    format_time(left, sizeof left, p->seconds_left);
    snprintf(text, size, "%s left  held-out %s  %s maps/s  loss %s  step %s", left, error, rate,
             loss, cli_format_count(p->step, step));
}

static void on_progress(void *user, const sdm_progress *p)
{
    char text[256];
    char maps_text[32], left[32];
    const bool makes_maps = p->phase == SDM_PHASE_DATA || p->phase == SDM_PHASE_BASES;
    format_time(left, sizeof left, p->seconds_left);
    if (p->phase == SDM_PHASE_TRIAL)
        snprintf(text, sizeof text, "%s left  short trials choose the kind of network", left);
    else if (p->phase == SDM_PHASE_BASES)
        snprintf(text, sizeof text, "%s left  preparations from %s exact maps", left,
                 cli_format_count(p->samples_at_start, maps_text));
    else if (p->phase == SDM_PHASE_EVALUATE)
        snprintf(text, sizeof text, "the model is trained and is measured now");
    else if (makes_maps)
        format_maps(p, text, sizeof text);
    else
        format_steps(p, text, sizeof text);
    // with a budget of steps the fraction of the budget is 0 until the first step
    const double maps = (double)p->samples / fmax((double)p->samples_at_start, 1);
    cli_progress_show(user, phase_name(p->phase),
                      makes_maps && !(p->fraction > 0) ? maps : p->fraction, text);
}

static void on_message(void *user, const char *line)
{
    cli_progress_clear(user);
    cli_notice("%s", line);
}

static void on_warning(void *user, const char *line)
{
    cli_progress_clear(user);
    cli_warn("%s", line);
}

sdm_train_hooks cli_train_hooks(cli_progress *progress)
{
    return (sdm_train_hooks){.progress = on_progress,
                             .cancelled = cli_interrupted,
                             .message = on_message,
                             .warning = on_warning,
                             .user = progress};
}
