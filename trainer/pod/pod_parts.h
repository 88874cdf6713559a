/* The parts of the error of a `pod` network: what its bases leave, and what the network leaves. */
#pragma once

#include "pod_state.h"
#include "state/kind.h"

/* Sets network, bases and modes of *out: errors of the averaged weights, in floats, on the held-out
   maps and on as many maps of the pool, random ones if there are any. The error of the bases is
   that of the coefficients with the smallest error, which a perfect network would compute. */
sdm_status trainer_pod_parts(const trainer *t, error_measures *out, sdm_error *err);
