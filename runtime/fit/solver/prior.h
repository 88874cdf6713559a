/* Prior densities of the shape parameters, the pose and the mean values inside. */
#pragma once

#include "problem.h"

/* Whether any unknown that is estimated has a prior. */
bool sdm_fit_has_prior(const fit_problem *p);

/* Whether unknown i is of a kind that has priors: all but the blur and the means outside. */
bool sdm_fit_may_have_prior(const fit_problem *p, size_t i);

/* Sd of parameter k before the fit, in the unit of the parameter: that of its prior or, without a
 * prior, that of the uniform distribution over its range. */
double sdm_fit_prior_sd(const fit_problem *p, size_t k);

/* Centre of the prior of parameter k, in the unit of the parameter: the mean of its distribution or
 * the middle of its range. */
double sdm_fit_prior_mean(const fit_problem *p, size_t k);

/* Log prior density of state s, up to a constant: Gaussians, each multiplied by
   problem->prior_weight. Adds its derivatives by the N = information.n_unknowns unknowns to
   gradient[N] and its negative second derivatives to complete[N][N] and observed[N][N]; each of the
   three may be NULL. */
double sdm_fit_prior(const fit_problem *p, const fit_state *s, double *gradient, double *complete,
                     double *observed);

/* Adds the weakest prior to the information matrix a[N][N], for parameters and pose that have no
   prior of their own: the precision of a uniform distribution over the range of a parameter and
   over all rotations, and a sd of the shape's reach for translations. This keeps the steps finite
   along directions that the data leave open, and does not move the maximum. */
void sdm_fit_add_weak_prior(const fit_problem *p, double *a);
