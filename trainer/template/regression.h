/* Polynomials of the shape's parameters, fitted by least squares to numbers that are known at
   random parameters. */
#pragma once

#include "sdm/internal/pod.h"

/* Numbers at S parameter vectors. */
typedef struct regression_data {
    size_t n_params, n_samples, n_numbers; /* P, S, N */
    const double *x;                       /* [S][P] parameters scaled to -1 .. 1 */
    const double *y;                       /* [S][N] */
    const double *weight; /* [N] effect of one unit of each number on the shape, mm */
} regression_data;

/* The polynomials as in sdm/internal/pod.h. */
typedef struct regression {
    size_t degree, n_terms; /* F */
    double *function;       /* [N][F] */
    double error;           /* largest over the numbers of weight * root mean square error, mm, on a
                               quarter of the samples that the choice of the degree left out */
} regression;

/* Largest number of terms of a fit to S samples. */
size_t trainer_regression_terms(size_t n_samples);

/* Fits polynomials of the lowest total degree whose error is at most `tolerance` (mm), or of the
   degree with the smallest error; degrees with more terms than trainer_regression_terms() are not
   tried. SDM_E_NOMEM; SDM_E_INTERNAL. Call trainer_regression_dispose() also after an error. */
sdm_status trainer_regression_fit(const regression_data *data, double tolerance, regression *out,
                                  sdm_error *err);
void trainer_regression_dispose(regression *r);
