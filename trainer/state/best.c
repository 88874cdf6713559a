/* Keeps the best weights of a phase. */
#include "best.h"

#include <math.h>
#include <string.h>

#include "progress.h"

/* The fraction by which the error must fall to count as a gain. */
static const double GAIN = 0.01;

bool trainer_best_note(const trainer *t, parameters *p, double fraction, double mse)
{
    if (!isfinite(mse)) return false;
    if (!(p->best_mse <= mse)) {
        p->best_mse = mse;
        memcpy(p->best, p->average, p->n * sizeof *p->best);
    }
    if (!(p->gain_mse * (1 - GAIN) <= mse)) {
        p->gain_mse = mse;
        p->gain_at = fraction;
    }
    const double patience = t->config->train.patience;
    return patience > 0 && fraction - p->gain_at > patience;
}

void trainer_ended_early(trainer *t, double fraction)
{
    const double used = trainer_seconds(t) - t->phase_started,
                 saved = used * (1 - fraction) / fmax(fraction, 1e-9);
    t->saved_seconds += saved;
    trainer_message(t,
                    "nothing more is gained: the phase ends at %.0f %% of its budget, %.0f s early "
                    "(train.patience)",
                    100 * fraction, saved);
}

void trainer_best_restore(trainer *t, parameters *p)
{
    if (!(p->best_mse < INFINITY)) return;
    memcpy(p->average, p->best, p->n * sizeof *p->best);
    t->heldout_mse = p->best_mse;
}
