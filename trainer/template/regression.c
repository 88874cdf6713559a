/* Least squares polynomials, with the degree chosen on samples that the fit leaves out. */
#include "regression.h"

#include <math.h>
#include <string.h>

#include "numerics/linalg.h"
#include "sdm/memory.h"

enum { DEGREE_MAX = 12, TERMS_MAX = 2048 };

size_t trainer_regression_terms(size_t n_samples)
{
    return n_samples / 3 < TERMS_MAX ? n_samples / 3 : TERMS_MAX;
}

void trainer_regression_dispose(regression *r)
{
    sdm_free(r->function);
    *r = (regression){0};
}

// true for the samples that decide on the degree
static bool is_test(size_t s) { return s % 4 == 3; }

// phi[S][F] of all samples
static sdm_status polynomials(const regression_data *d, size_t degree, size_t terms, float **phi,
                              sdm_error *err)
{
    uint8_t *exponents = NULL;
    sdm_status s = SDM_ALLOC(&exponents, terms * d->n_params, "polynomials", err);
    if (!s) s = SDM_ALLOC(phi, d->n_samples * terms, "polynomials", err);
    if (!s) {
        sdm_poly_table(d->n_params, degree, exponents);
        for (size_t i = 0; i < d->n_samples; i++)
            sdm_poly_eval(exponents, terms, d->n_params, degree, d->x + i * d->n_params,
                          *phi + i * terms, NULL);
    }
    sdm_free(exponents);
    return s;
}

// function[N][F] = least squares solution; all: with the test samples
static sdm_status solve(const regression_data *d, size_t terms, const float *phi, bool all,
                        double *function, sdm_error *err)
{
    const size_t n = d->n_numbers;
    double *gram = NULL, *right = NULL;
    sdm_status s = SDM_ALLOC(&gram, terms * terms, "polynomials", err);
    if (!s) s = SDM_ALLOC(&right, terms * n, "polynomials", err);
    for (size_t i = 0; i < d->n_samples && !s; i++) {
        if (!all && is_test(i)) continue;
        const float *f = phi + i * terms;
        const double *y = d->y + i * n;
        for (size_t t = 0; t < terms; t++) {
            const double ft = (double)f[t];
            for (size_t u = 0; u <= t; u++) gram[t * terms + u] += ft * (double)f[u];
            for (size_t k = 0; k < n; k++) right[t * n + k] += ft * y[k];
        }
    }
    if (!s) {
        for (size_t t = 0; t < terms; t++)
            gram[t * terms + t] *= 1 + 1e-10, gram[t * terms + t] += 1e-12;
        if (trainer_cholesky(terms, gram))
            s = sdm_fail(err, SDM_E_INTERNAL, "the polynomials have no least squares solution");
    }
    if (!s) {
        trainer_cholesky_solve(terms, gram, n, right);
        for (size_t k = 0; k < n; k++)
            for (size_t t = 0; t < terms; t++) function[k * terms + t] = right[t * n + k];
    }
    sdm_free(right);
    sdm_free(gram);
    return s;
}

static double test_error(const regression_data *d, size_t terms, const float *phi,
                         const double *function)
{
    double largest = 0;
    for (size_t k = 0; k < d->n_numbers; k++) {
        double sum = 0;
        size_t n = 0;
        for (size_t i = 0; i < d->n_samples; i++) {
            if (!is_test(i)) continue;
            double v = 0;
            for (size_t t = 0; t < terms; t++)
                v += function[k * terms + t] * (double)phi[i * terms + t];
            const double e = v - d->y[i * d->n_numbers + k];
            sum += e * e, n++;
        }
        largest = fmax(largest, d->weight[k] * sqrt(sum / (double)(n ? n : 1)));
    }
    return largest;
}

sdm_status trainer_regression_fit(const regression_data *d, double tolerance, regression *out,
                                  sdm_error *err)
{
    *out = (regression){.error = INFINITY};
    sdm_status s = SDM_OK;
    size_t worse = 0;
    for (size_t degree = 0; degree <= DEGREE_MAX && !s && out->error > tolerance && worse < 2;
         degree++) {
        const size_t terms = sdm_poly_count(d->n_params, degree);
        if (terms > trainer_regression_terms(d->n_samples)) break;
        float *phi = NULL;
        double *function = NULL;
        s = polynomials(d, degree, terms, &phi, err);
        if (!s) s = SDM_ALLOC(&function, d->n_numbers * terms, "polynomials", err);
        if (!s) s = solve(d, terms, phi, false, function, err);
        const double error = s ? INFINITY : test_error(d, terms, phi, function);
        if (!s && (error < out->error || degree == 0)) {
            // keep this degree, fitted to all samples
            sdm_free(out->function);
            *out = (regression){degree, terms, function, error};
            function = NULL;
            s = solve(d, terms, phi, true, out->function, err);
            worse = 0;
        } else {
            worse++;
        }
        sdm_free(function);
        sdm_free(phi);
    }
    return s;
}
