/* Parameters that the data of a fit hardly determine. */
#pragma once

#include "sdm/fit.h"

/* Standard deviation of such a parameter, over that before the fit, from which on it is named. */
#define SDM_FIT_HARDLY_KNOWN 0.25

/* Room for the names of such parameters in the text of a finding. */
#define SDM_FIT_NAMES_MAX 200

/* Whether the data hardly determine parameter k: false where it is kept, and where its standard
   deviation is unknown. */
static inline bool sdm_fit_hardly_known(const sdm_fit_result *r, size_t k)
{
    return r->sd[k] > SDM_FIT_HARDLY_KNOWN * r->prior_sd[k];
}
