/* Cancellation by the function that the caller gives in the options. */
#include "cancel.h"

#include "sdm/internal/threads.h"

bool sdm_cancelled(const sdm_exact_opts *opts)
{
    return sdm_thread() == 0 && opts->cancelled && opts->cancelled(opts->user);
}

sdm_status sdm_cancel_check(const sdm_exact_opts *opts, sdm_error *err)
{
    if (!opts || !opts->cancelled || !opts->cancelled(opts->user)) return SDM_OK;
    return sdm_fail(err, SDM_E_CANCELLED, "preparation of the mesh stopped on request");
}
