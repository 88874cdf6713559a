/* A fit that only has to show how well another shape explains the target. */
#pragma once

#include "sdm/fit.h"

/* As sdm_fit(), but only as far as sdm_fit_compare() needs it: the steps with exact maps end at
   1e-3 where polish_eps is less, which changes the evidence by a fraction of its unit, and there is
   no check SDM_FIT_CHECK_NEXT_POSE. */
sdm_status sdm_fit_rival(const sdm_fit_source *source, const sdm_fit_target *target,
                         const sdm_fit_opts *opts, sdm_fit_result *out, sdm_error *err);
