/* The model of the kind that network.kind: auto has trained and not chosen. */
#pragma once

#include "state/trainer.h"

/* Of the second of two trainings, before model.sdm is written: keeps the model of the kind that
   loses as model-KIND.sdm beside model.sdm. won: the second kind is chosen, so the loser's is still
   the file model.sdm; else it is that of t. report->other_path = the file. A failure is told alone:
   it is no reason to lose the other model. */
void trainer_other_model_keep(const trainer *t, bool won, sdm_train_report *report);
