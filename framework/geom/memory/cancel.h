/* Cancellation: asks the caller's `cancelled` function whether to stop. */
#pragma once

#include "sdm/exact.h"

/* True when opts->cancelled returns true. All threads of a parallel loop may call this, but only
 * the calling thread of the library (number 0) calls opts->cancelled; the others get false. */
bool sdm_cancelled(const sdm_exact_opts *opts);

/* For the preparation of a mesh, which one thread does: SDM_E_CANCELLED when opts->cancelled
 * returns true. opts may be NULL: never cancelled. */
sdm_status sdm_cancel_check(const sdm_exact_opts *opts, sdm_error *err);
