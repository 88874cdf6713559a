/* Small symmetric linear systems. Matrices are [n][n], row-major, n <= FIT_UNKNOWNS_MAX. */
#pragma once

#include "fit/data/unknowns.h"

/* Computes the Cholesky factor (lower triangle of factor[n][n]) of the matrix a[n][n], scaled to a
   unit diagonal by scale[n]. Reads the lower triangle of a. False: a is not positive definite
   beyond rounding. */
bool sdm_fit_cholesky(size_t n, const double *a, double *factor, double *scale);

/* x[n] := a^-1 x, with factor and scale from sdm_fit_cholesky(). */
void sdm_fit_solve(size_t n, const double *factor, const double *scale, double *x);

/* inverse[n][n] of a without the unknowns that are held, whose rows and columns are 0. work: 2 n n
   numbers. False: a without them is not positive definite; inverse is 0. */
bool sdm_fit_inverse(size_t n, const double *a, const bool *held, double *inverse, double *work);

/* Limits of a step. kept: the unknown does not move; else min <= step <= max, with min <= 0 <= max.
 */
typedef struct fit_limits {
    bool kept[FIT_UNKNOWNS_MAX];
    double min[FIT_UNKNOWNS_MAX], max[FIT_UNKNOWNS_MAX];
} fit_limits;

/* step[n] maximises gradient . step - 1/2 step . (a + damping diag a) step within the limits. The
   method is an active set that only grows: an unknown that was stopped at a limit is not released,
   so with several limits the step may fall short of the maximum. work: 2 n n numbers. False: a,
   with its damping and without the unknowns at limits, is not positive definite. */
bool sdm_fit_bounded_step(size_t n, const double *a, const double *gradient, double damping,
                          const fit_limits *limits, double *step, double *work);
