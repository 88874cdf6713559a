/* Refinement: MLP, head, bases and mean map are trained together, end to end on maps. */
#pragma once

#include "pod_state.h"

/* Allocates the weights of the phase and, unless resumed, sets them but for the head: MLP from the
   mode fit, bases and mean map as computed. resumed: trainer_checkpoint_weights() fills them. */
sdm_status trainer_refine_start(pod_state *pod, bool resumed, sdm_error *err);

/* Gives all ranks all weights of the phase: during the phase each has those of its trees and of
   their rows of the head, and of the MLP. */
sdm_status trainer_refine_gather(pod_state *pod, sdm_error *err);

/* Runs phase SDM_PHASE_REFINE to its end; nothing if train.refine is 0. */
sdm_status trainer_refine_run(pod_state *pod, sdm_error *err);

/* *mse = mean square error (mm^2) of the network with weights w on the held-out maps. */
sdm_status trainer_refine_evaluate(pod_state *pod, const float *w, double *mse, sdm_error *err);

/* Notes this error in t->heldout_mse and in a line of the metrics with the learning rate `rate`. */
sdm_status trainer_refine_note(pod_state *pod, const float *w, double rate, sdm_error *err);
