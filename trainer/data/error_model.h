/* Regression of the network's error over the shape parameters: a polynomial for the logarithm of
   the error (products of Legendre polynomials of bounded total degree, sdm/internal/pod.h), fitted
   by least squares. Its degree is the highest one with at least four observations per term. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/pod.h"
#include "sdm/status.h"

#define ERROR_MODEL_MAX_TERMS 256

typedef struct error_model {
    size_t n_params, degree, n_terms; /* n_terms == 1: a constant */
    uint8_t *exponents;               /* [n_terms][n_params] */
    double *weights;                  /* [n_terms] */
} error_model;

/* Fits the model to n observations: parameters x[n][n_params] scaled to -1 .. 1, value[n] =
   logarithm of the error. Few observations give a constant, n == 0 gives the constant 0. */
sdm_status trainer_error_model_fit(error_model *m, size_t n_params, size_t n, const double *x,
                                   const double *value, sdm_error *err);

/* Predicted logarithm of the error at x[n_params]. */
double trainer_error_model_at(const error_model *m, const double *x);
void trainer_error_model_dispose(error_model *m);
