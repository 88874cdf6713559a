/* The mode fit: the MLP learns the part of the mode coefficients that the polynomials leave over.
   Its steps are cheap, since no map is touched; with orthonormal bases the squared error of the
   coefficients is the squared error of the map. */
#pragma once

#include "pod_state.h"

/* Runs phase SDM_PHASE_MODE_FIT from t->phase_step to its end; nothing if the network has no MLP.
 */
sdm_status trainer_mode_fit_run(pod_state *pod, sdm_error *err);

/* error[n] = root mean square error (mm) of the maps in slots[n] due to the mode coefficients, with
   the averaged weights. */
sdm_status trainer_mode_fit_errors(const pod_state *pod, const size_t *slots, size_t n,
                                   double *error, sdm_error *err);
