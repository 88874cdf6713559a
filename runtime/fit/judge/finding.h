/* A finding of the verdict. */
#pragma once

#include "fit/data/samples.h"
#include "sdm/fit.h"
#include "sdm/internal/shared.h"

/* Adds a finding to the verdict: passed without a text, or `grade` with the text. */
void sdm_fit_judge_add(sdm_fit_verdict *v, sdm_fit_check_kind kind, bool passed,
                       sdm_fit_grade grade, double figure, double limit, const char *fmt, ...)
    SDM_PRINTF(7, 8);

/* Size of the array that sdm_fit_name_place() writes to. */
enum { FIT_PLACE_NAME = 120 };

/* text = "(1, 2, 3) mm, in the shape's frame (4, 5, 6)": the point x (mm) of the data, and the same
 * point before the pose of the shape was applied. Returns text. */
const char *sdm_fit_name_place(const fit_state *s, const double x[3], char text[FIT_PLACE_NAME]);
