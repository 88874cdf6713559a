/* Small dense linear algebra of the spectral start. The same bits for any number of threads. */
#ifndef SDM_LINALG_H
#define SDM_LINALG_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* Eigenvalues (descending, into values[n]) and eigenvectors (rows of a, in the same order) of the
   symmetric a[n][n], in place: Householder reduction and implicit QL (Bowdler, Martin, Reinsch and
   Wilkinson 1968). SDM_E_INTERNAL when it does not converge. */
sdm_status eigen_symmetric(size_t n, double *a, double *values, sdm_error *err);

/* Cholesky factor of the symmetric positive definite a[n][n], lower, in place; 0, or the 1-based
 * row that is not positive. */
size_t cholesky(size_t n, double *a);

/* Solves (L L^T) X = B for B[n][columns] in place. */
void cholesky_solve(size_t n, const double *l, size_t columns, double *b);

/* Makes the rows of x[k][n] orthonormal, spanning the same space (shifted Cholesky QR, Fukaya et
 * al. 2020). */
sdm_status orthonormalise(size_t k, size_t n, float *x, int n_threads, sdm_error *err);

/* The leading eigenvectors of the covariance c[n][n] (symmetric, float): rows of basis[k][n],
   values[k] descending, by subspace iteration from counter-based random rows (Halko, Martinsson and
   Tropp 2011). One thread. */
sdm_status leading_eigenvectors(size_t n, const float *c, size_t k, uint64_t seed, uint64_t stream,
                                float *basis, double *values, sdm_error *err);

/* An orthonormal basis rows[k][n] of the leading right singular space of y[m][n] by randomised
 * subspace iteration. */
sdm_status leading_space(size_t m, size_t n, const float *y, size_t k, uint64_t seed, int n_threads,
                         float *rows, sdm_error *err);

#endif
