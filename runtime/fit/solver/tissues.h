/* Re-estimation of the tissues' appearance between Newton steps: weights, sd and (labels) means of
   the tissues, and the sd of points. With partial volume the means are unknowns of Newton's method.
 */
#pragma once

#include "problem.h"

/* largest count of numbers that sdm_fit_appearance_pack() writes */
enum { FIT_APPEARANCE_MAX = 3 * FIT_TISSUES_MAX };

/* Writes the re-estimated part of problem->state to x[FIT_APPEARANCE_MAX] as unbounded numbers of
   similar scale (logarithms of weights and sd; means divided by the contrast at the start). Returns
   the count of numbers. */
size_t sdm_fit_appearance_pack(const fit_problem *p, double *x);

/* The inverse of sdm_fit_appearance_pack(): sets problem->state and its observation model from x;
 * weights are normalised. */
void sdm_fit_appearance_unpack(fit_problem *p, const double *x);

/* Decides anew which tissues the image does not hold: those that account for at most
   max(problem->noise_factor, 10) samples. Their mean and sd return to the start values and keep
   them until the next call. Has no effect unless the target is an image and its appearance is
   estimated. */
void sdm_fit_appearance_mark_absent(fit_problem *p);

/* One step of re-estimation of the tissue field and the appearance in problem->state; updates
 * observation model and information. For label maps it does nothing. */
sdm_status sdm_fit_appearance_update(fit_problem *p, sdm_error *err);
