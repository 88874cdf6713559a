/* The inverse of the information matrix, for the unknowns that a fit estimates: the covariance of
 * the estimate, if the samples are independent. */
#pragma once

#include "fit/solver/problem.h"

/* Writes the indices of the unknowns that the fit estimates (no option keeps their values) to
 * list[N], N = p->information.n_unknowns. Returns their number. */
size_t sdm_fit_free_unknowns(const fit_problem *p, size_t *list);

/* influence[N][N], N = p->information.n_unknowns: the inverse, 0 for unknowns that the fit
 * does not estimate. Inverts the observed information where it is positive definite, else the
 * complete one. work: 3 N N numbers. false: neither is positive definite. */
bool sdm_fit_influence(const fit_problem *p, bool with_priors, double *influence, double *work);
