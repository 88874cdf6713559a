/* Re-estimation of the tissues' appearance between Newton steps: weights, sd and (labels) means of
   the tissues, and the sd of points. With partial volume the means are unknowns of Newton's method.
 */
#ifndef FIT_TISSUES_H
#define FIT_TISSUES_H

#include "problem.h"

/* numbers of sdm_fit_appearance_pack() at most */
enum { FIT_APPEARANCE_MAX = 3 * FIT_TISSUES_MAX };

/* Writes what is re-estimated in problem->state to x[FIT_APPEARANCE_MAX] as unbounded numbers of
   similar scale (logarithms of weights and sd; means over the contrast of the start). Returns their
   number. */
size_t sdm_fit_appearance_pack(const fit_problem *p, double *x);

/* The inverse: sets problem->state and its observation model from x; weights are normalised. */
void sdm_fit_appearance_unpack(fit_problem *p, const double *x);

/* Decides anew which tissues the image does not hold: those with less than one independent sample,
   or with fewer than ten. They take mean and sd of the start and keep them until the next call.
   Images with an estimated appearance only. */
void sdm_fit_appearance_mark_absent(fit_problem *p);

/* One step of re-estimation of the tissue field and the appearance in problem->state; updates
   observation model and information. Nothing to do for label maps. */
sdm_status sdm_fit_appearance_update(fit_problem *p, sdm_error *err);

#endif
