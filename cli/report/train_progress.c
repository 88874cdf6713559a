/* Shows the progress of a training (step, loss, error, time left, speed) and prints its notices. */
#include "train_progress.h"

#include <math.h>
#include <stdio.h>

#include "terminal.h"

static const char *phase_name(sdm_phase phase)
{
    switch (phase) {
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

/* Formats a rate as "850", "18k" or "2.1M". */
static void format_rate(char buf[32], double rate)
{
    if (!(rate >= 0)) rate = 0;
    if (rate < 9999.5)
        snprintf(buf, 32, "%.0f", rate);
    else if (rate < 999.5e3)
        snprintf(buf, 32, "%.0fk", rate / 1e3);
    else
        snprintf(buf, 32, "%.1fM", rate / 1e6);
}

static void on_progress(void *user, const sdm_progress *p)
{
    char count[32], loss[32] = "-", error[32] = "-", left[32], rate[32], text[256];
    format_time(left, sizeof left, p->seconds_left);
    if (p->phase == SDM_PHASE_DATA || p->phase == SDM_PHASE_BASES) {
        snprintf(text, sizeof text, "%s exact maps  %s left", cli_format_count(p->samples, count),
                 left);
    } else {
        if (isfinite(p->loss)) snprintf(loss, sizeof loss, "%.1e", p->loss);
        if (isfinite(p->heldout_rmse_mm))
            snprintf(error, sizeof error, "%.4f mm", p->heldout_rmse_mm);
        format_rate(rate, p->samples_per_second);
        snprintf(text, sizeof text, "step %s  loss %s  held-out %s  %s left  %s samples/s",
                 cli_format_count(p->step, count), loss, error, left, rate);
    }
    cli_progress_show(user, phase_name(p->phase), p->fraction, text);
}

static void on_message(void *user, const char *line)
{
    cli_progress_clear(user);
    cli_notice("%s", line);
}

sdm_train_hooks cli_train_hooks(cli_progress *progress)
{
    return (sdm_train_hooks){.progress = on_progress,
                             .cancelled = cli_interrupted,
                             .message = on_message,
                             .user = progress};
}
