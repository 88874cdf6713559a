/* What the preparation of a mesh may take of memory, what it has taken so far, and whether it is to
 * go on. */
#ifndef SDM_GEOM_BUDGET_H
#define SDM_GEOM_BUDGET_H

#include <stdbool.h>
#include <stddef.h>

#include "sdm/exact.h"

typedef struct sdm_budget {
    size_t limit; /* bytes; 0: none */
    size_t used;
    size_t n_tri;               /* of the mesh, for the message */
    const sdm_exact_opts *opts; /* of which `cancelled` is asked */
} sdm_budget;

/* To be asked before `bytes` more are allocated; SDM_E_NOMEM when they go beyond the limit. b may
   be NULL. What is given back is subtracted from `used` by who gives it back. */
sdm_status sdm_budget_take(sdm_budget *b, size_t bytes, sdm_error *err);

/* Asks the caller whether to stop; for all threads of a loop, but only the first one asks. */
bool sdm_cancelled(const sdm_exact_opts *opts);

/* The same of a preparation, to be asked now and then; SDM_E_CANCELLED when the caller wants the
 * preparation to stop. b may be NULL. */
sdm_status sdm_budget_ask(const sdm_budget *b, sdm_error *err);

#endif
