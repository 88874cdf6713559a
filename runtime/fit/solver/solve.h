/* Small symmetric systems. Matrices are [n][n], n at most FIT_UNKNOWNS_MAX. */
#ifndef FIT_SOLVE_H
#define FIT_SOLVE_H

#include "fit/data/problem.h"

/* Cholesky factor of a scaled to a unit diagonal. False: a is not positive definite beyond
 * rounding. */
bool sdm_fit_factorise(size_t n, const double *a, double *factor, double *scale);

/* x := a^-1 x. */
void sdm_fit_back(size_t n, const double *factor, const double *scale, double *x);

/* What each unknown may do in a step: nothing, or move within [least, most], least <= 0 <= most. */
typedef struct fit_limits {
    bool kept[FIT_UNKNOWNS_MAX];
    double least[FIT_UNKNOWNS_MAX], most[FIT_UNKNOWNS_MAX];
} fit_limits;

/* step = argmax of gradient . step - 1/2 step . (a + damping diag a) step within the limits, by an
   active set. work: 2 n n. False: a is not positive definite. */
bool sdm_fit_step(size_t n, const double *a, const double *gradient, double damping,
                  const fit_limits *limits, double *step, double *work);

#endif
