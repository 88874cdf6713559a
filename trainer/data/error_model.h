/* Regression of a network's error on the parameters: the logarithm of the error as a polynomial
   (products of Legendre polynomials of bounded total degree, sdm/pod.h) by least squares. The
   degree is the highest that the number of observations can determine. */
#ifndef SDM_ERROR_MODEL_H
#define SDM_ERROR_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/pod.h"
#include "sdm/status.h"

#define ERROR_MODEL_MAX_TERMS 256

typedef struct error_model {
    size_t n_params, degree, n_terms; /* one term: a constant */
    uint8_t *exponents;               /* [n_terms][n_params] */
    double *weights;                  /* [n_terms] */
} error_model;

/* From n observations: x[n][n_params] in -1 .. 1, value[n] logarithms. Few observations give a
 * constant, none gives 0. */
sdm_status error_model_fit(error_model *m, size_t n_params, size_t n, const double *x,
                           const double *value, sdm_error *err);
/* The logarithm of the error at x[n_params]. */
double error_model_at(const error_model *m, const double *x);
void error_model_dispose(error_model *m);

#endif
