/* The inverse of the information of the unknowns that were estimated. */
#pragma once

#include "fit/solver/problem.h"

/* list[]: indices of the unknowns that were estimated; returns their number. */
size_t sdm_fit_free_unknowns(const fit_problem *p, size_t *list);

/* influence[N][N], N = p->information.n_unknowns: the inverse, 0 for unknowns that were not
 * estimated. Inverts the observed information where it is positive definite, else the complete one.
 * work: 3 N N numbers. false: neither is positive definite. */
bool sdm_fit_influence(const fit_problem *p, bool with_priors, double *influence, double *work);
