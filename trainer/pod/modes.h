/* Global modes of the local coefficients, their polynomial part and the targets of the MLP. */
#pragma once

#include "pod_state.h"

/* Computes modes, deviation, poly and target_scale from the maps in slots 0 .. n - 1, and phi and
   target of these slots and of the held-out maps. SDM_E_CONFIG: n maps cannot determine the
   polynomials. */
sdm_status trainer_modes_make(pod_state *pod, size_t n, sdm_error *err);

/* Computes phi and target of the maps in slots[n]. */
sdm_status trainer_modes_project(pod_state *pod, const size_t *slots, size_t n, sdm_error *err);
