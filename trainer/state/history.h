/* The errors of a run over its steps, as the lines of metrics.jsonl tell them. */
#pragma once

#include "trainer.h"

typedef struct history_point {
    sdm_phase phase;      /* SDM_PHASE_MODE_FIT, SDM_PHASE_REFINE or SDM_PHASE_EVALUATE */
    double step, seconds; /* seconds: NaN without a budget of time */
    double loss, heldout; /* mean square errors, mm^2; NaN: not known */
} history_point;

typedef struct history {
    size_t n;
    history_point *point; /* [n], in the order of time */
} history;

/* Reads the lines of t->metrics with a step, those of the kind trained last. Call
 * trainer_history_dispose() also after an error. */
sdm_status trainer_history_read(const trainer *t, history *out, sdm_error *err);
void trainer_history_dispose(history *h);

/* Step of the last line; -1 if there is none. */
int64_t trainer_history_last_step(const history *h);

/* The part of the held-out root mean square error beyond `floor` (mm^2) that the last third of the
   steps of a phase took away, 0 .. 1, averaged weights; 0 if the error rose, NaN if it was measured
   fewer than three times in this phase. */
double trainer_history_fall(const history *h, sdm_phase phase, double floor);

/* Draws loss.png: the root mean square errors of the training batches, of the held-out shapes, and
   of the finished model. The axis is the time in seconds; without a budget of time, the step. A
   line shows where the refinement begins, whose batches are others. */
sdm_status trainer_history_picture(const trainer *t, const history *h, sdm_error *err);
