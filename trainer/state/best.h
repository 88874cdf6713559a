/* The best weights of a phase by the error on held-out shapes, and the end of a phase in which
   nothing more is gained (train.patience). */
#pragma once

#include "trainer.h"

/* Notes the held-out error `mse` (mm^2) of p->average at `fraction` (0 .. 1) of the phase's budget:
   keeps a copy of the weights if no earlier error was smaller. Returns true if the phase is to end:
   for more than train.patience of its budget the error has not fallen by 1 %. */
bool trainer_best_note(const trainer *t, parameters *p, double fraction, double mse);

/* Tells the user that the phase ends at `fraction` of its budget, and the time saved. */
void trainer_ended_early(trainer *t, double fraction);

/* At the end of a phase: p->average = the weights with the smallest error, which becomes
   t->heldout_mse. */
void trainer_best_restore(trainer *t, parameters *p);
