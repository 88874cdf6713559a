/* Counting memory against a limit. */
#include "budget.h"

#include <stdint.h>

sdm_status sdm_budget_take(sdm_budget *b, size_t bytes, sdm_error *err)
{
    if (!b) return SDM_OK;
    b->used = bytes > SIZE_MAX - b->used ? SIZE_MAX : b->used + bytes;
    if (!b->limit || b->used <= b->limit) return SDM_OK;
    return sdm_fail(err, SDM_E_NOMEM,
                    "the mesh of %zu triangles needs at least %zu bytes to prepare, memory_limit is %zu; raise it or "
                    "use a coarser mesh",
                    b->n_tri, b->used, b->limit);
}
