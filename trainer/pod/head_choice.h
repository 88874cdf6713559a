/* Chooses the head after the mode fit. */
#pragma once

#include "pod_state.h"

/* Sets the head of the weights pod->refine, also of their average: by least squares; where maps are
   few, between least squares and the network of the mode fit, whichever has the smallest error on
   held-out maps. *mse = mean square error (mm^2) on these maps. */
sdm_status trainer_head_choose(pod_state *pod, double *mse, sdm_error *err);
