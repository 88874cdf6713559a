/* A finding of the verdict. */
#pragma once

#include "sdm/fit.h"
#include "sdm/internal/shared.h"

/* Adds a finding to the verdict: passed without a text, or `grade` with the text. */
void sdm_fit_judge_add(sdm_fit_verdict *v, sdm_fit_check_kind kind, bool passed,
                       sdm_fit_grade grade, double figure, double limit, const char *fmt, ...)
    SDM_PRINTF(7, 8);
