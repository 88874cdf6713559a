/* Counting memory against a limit, and asking the caller. */
#include "budget.h"

#include <stdint.h>

#include "sdm/internal/threads.h"

sdm_status sdm_budget_take(sdm_budget *b, size_t bytes, sdm_error *err)
{
    if (!b) return SDM_OK;
    b->used = bytes > SIZE_MAX - b->used ? SIZE_MAX : b->used + bytes;
    if (!b->limit || b->used <= b->limit) return SDM_OK;
    return sdm_fail(err, SDM_E_NOMEM,
                    "the mesh of %zu triangles needs at least %zu bytes to prepare, memory_limit "
                    "is %zu; raise it or "
                    "use a coarser mesh",
                    b->n_tri, b->used, b->limit);
}

bool sdm_cancelled(const sdm_exact_opts *opts)
{
    return sdm_thread() == 0 && opts->cancelled && opts->cancelled(opts->user);
}

sdm_status sdm_budget_ask(const sdm_budget *b, sdm_error *err)
{
    if (!b || !sdm_cancelled(b->opts)) return SDM_OK;
    return sdm_fail(err, SDM_E_CANCELLED, "preparation of the mesh stopped on request");
}
