/* Dense linear algebra of the trainer. Matrices are row-major. Results do not depend on the number
   of threads, bit by bit. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/comm.h"
#include "sdm/status.h"

/* Eigenvalues values[n], in descending order, and eigenvectors of the symmetric a[n][n]; on return
   row i of a is the eigenvector of values[i]. Householder reduction and implicit QL (Bowdler,
   Martin, Reinsch and Wilkinson 1968). SDM_E_INTERNAL if it does not converge. */
sdm_status trainer_eigen_symmetric(size_t n, double *a, double *values, sdm_error *err);

/* Overwrites the lower triangle of the symmetric positive definite a[n][n] with its Cholesky factor
   L. Returns 0, or the number (from 1) of the first row whose pivot is not positive. */
size_t trainer_cholesky(size_t n, double *a);

/* Solves (L L^T) X = B for n rows and `columns` right-hand sides; l[n][n] comes from
   trainer_cholesky(), b[n][columns] is overwritten with X. */
void trainer_cholesky_solve(size_t n, const double *l, size_t columns, double *b);

/* Replaces the rows of x[k][n] by orthonormal rows that span the same space (shifted Cholesky QR,
   Fukaya et al. 2020). SDM_E_INTERNAL if the rows stay linearly dependent, SDM_E_NOMEM. */
sdm_status trainer_orthonormalise(size_t k, size_t n, float *x, int n_threads, sdm_error *err);

/* The k leading eigenvectors of the symmetric covariance c[n][n], as orthonormal rows of
   basis[k][n], with their eigenvalues values[k] in descending order. Method: subspace iteration
   that starts from random numbers (seed, stream); Halko, Martinsson and Tropp 2011; of a small
   matrix all eigenvectors where more than half are asked for. One thread. */
sdm_status trainer_leading_eigenvectors(size_t n, const float *c, size_t k, uint64_t seed,
                                        uint64_t stream, float *basis, double *values,
                                        sdm_error *err);

/* rows[k][n] = an orthonormal basis of the space of the k leading right singular vectors of
   y[m][n], by subspace iteration from random numbers (seed, stream). The ranks of comm, which all
   have y, share the products with it. */
sdm_status trainer_leading_space(sdm_comm *comm, size_t m, size_t n, const float *y, size_t k,
                                 uint64_t seed, uint64_t stream, int n_threads, float *rows,
                                 sdm_error *err);
