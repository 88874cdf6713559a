/* Least squares fit of a polynomial to the logarithm of the error. */
#include "error_model.h"

#include "numerics/linalg.h"
#include "sdm/memory.h"

enum { MAX_DEGREE = 4, OBSERVATIONS_PER_TERM = 4 };

static size_t degree_for(size_t n_params, size_t n)
{
    size_t degree = MAX_DEGREE, terms = n / OBSERVATIONS_PER_TERM;
    if (terms > ERROR_MODEL_MAX_TERMS) terms = ERROR_MODEL_MAX_TERMS;
    while (degree > 0 && sdm_poly_count(n_params, degree) > terms) degree--;
    return degree;
}

/* Adds the normal equations of the n observations, with F = n_terms: matrix gram[F][F], right-hand
 * side right[F]. */
static void add_normal_equations(const error_model *m, size_t n, const double *x,
                                 const double *value, double *gram, double *right)
{
    float phi[ERROR_MODEL_MAX_TERMS];
    const size_t f = m->n_terms;
    for (size_t i = 0; i < n; i++) {
        sdm_poly_eval(m->exponents, f, m->n_params, m->degree, x + i * m->n_params, phi, NULL);
        for (size_t j = 0; j < f; j++) {
            right[j] += value[i] * phi[j];
            for (size_t k = 0; k <= j; k++) gram[j * f + k] += (double)phi[j] * phi[k];
        }
    }
    // ridge with the weight of one observation: terms that the observations hardly determine stay
    // small
    for (size_t j = 0; j < f; j++) {
        gram[j * f + j] += 1;
        for (size_t k = 0; k < j; k++) gram[k * f + j] = gram[j * f + k];
    }
}

sdm_status trainer_error_model_fit(error_model *m, size_t n_params, size_t n, const double *x,
                                   const double *value, sdm_error *err)
{
    *m = (error_model){.n_params = n_params, .degree = degree_for(n_params, n)};
    const size_t f = m->n_terms = sdm_poly_count(n_params, m->degree);
    double *gram = NULL;
    sdm_status s = SDM_ALLOC(&m->exponents, f * n_params, "error model", err);
    if (!s) s = SDM_ALLOC(&m->weights, f, "error model", err);
    if (!s) s = SDM_ALLOC(&gram, f * f, "error model", err);
    if (!s) {
        sdm_poly_table(n_params, m->degree, m->exponents);
        add_normal_equations(m, n, x, value, gram, m->weights);
        if (trainer_cholesky(f, gram))
            s = sdm_fail(err, SDM_E_INTERNAL, "the error model of %zu observations has no solution",
                         n);
        else
            trainer_cholesky_solve(f, gram, 1, m->weights);
    }
    sdm_free(gram);
    if (s) trainer_error_model_dispose(m);
    return s;
}

double trainer_error_model_at(const error_model *m, const double *x)
{
    float phi[ERROR_MODEL_MAX_TERMS];
    sdm_poly_eval(m->exponents, m->n_terms, m->n_params, m->degree, x, phi, NULL);
    double sum = 0;
    for (size_t j = 0; j < m->n_terms; j++) sum += m->weights[j] * phi[j];
    return sum;
}

void trainer_error_model_dispose(error_model *m)
{
    sdm_free(m->exponents);
    sdm_free(m->weights);
    *m = (error_model){0};
}
