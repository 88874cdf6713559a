/* Products of Legendre polynomials of bounded total degree. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "sdm/internal/pod.h"

#define MAX_DEGREE 16

size_t sdm_poly_count(size_t n, size_t degree)
{
    // binomial(n + degree, degree); each partial product is itself a binomial coefficient, so that
    // the division is exact
    size_t c = 1;
    for (size_t i = 1; i <= degree; i++) {
        if (c > SIZE_MAX / (n + i)) return SIZE_MAX;
        c = c * (n + i) / i;
    }
    return c;
}

// Appends all products whose degrees in variables v .. n - 1 add up to `left`; the degrees of the
// variables before v are in current[]. Returns the end of the table.
static uint8_t *exponents_fill(size_t n, size_t v, size_t left, uint8_t *current, uint8_t *out)
{
    if (v + 1 == n) {
        current[v] = (uint8_t)left;
        memcpy(out, current, n);
        return out + n;
    }
    for (size_t e = left + 1; e-- > 0;) {
        current[v] = (uint8_t)e;
        out = exponents_fill(n, v + 1, left - e, current, out);
    }
    return out;
}

void sdm_poly_table(size_t n, size_t degree, uint8_t *exponents)
{
    uint8_t current[SDM_POD_MAX_PARAMS] = {0};
    for (size_t d = 0; d <= degree; d++) exponents = exponents_fill(n, 0, d, current, exponents);
}

void sdm_poly_eval(const uint8_t *exponents, size_t n_terms, size_t n, size_t degree,
                   const double *x, float *phi, float *dphi)
{
    // normalised Legendre polynomials of each variable, and their derivatives
    double value[SDM_POD_MAX_PARAMS][MAX_DEGREE + 1], slope[SDM_POD_MAX_PARAMS][MAX_DEGREE + 1];
    for (size_t v = 0; v < n; v++) {
        // (k + 1) P(k+1) = (2k + 1) x P(k) - k P(k-1), P'(k+1) = P'(k-1) + (2k + 1) P(k)
        double p[MAX_DEGREE + 1] = {1, x[v]}, q[MAX_DEGREE + 1] = {0, 1};
        for (size_t k = 1; k < degree; k++) {
            const double dk = (double)k;
            p[k + 1] = ((2 * dk + 1) * x[v] * p[k] - dk * p[k - 1]) / (dk + 1);
            q[k + 1] = q[k - 1] + (2 * dk + 1) * p[k];
        }
        for (size_t k = 0; k <= degree; k++) {
            const double norm = sqrt(2.0 * (double)k + 1);
            value[v][k] = norm * p[k], slope[v][k] = norm * q[k];
        }
    }
    // their products
    for (size_t t = 0; t < n_terms; t++, exponents += n) {
        double product = 1;
        for (size_t v = 0; v < n; v++) product *= value[v][exponents[v]];
        phi[t] = (float)product;
        if (!dphi) continue;
        for (size_t d = 0; d < n; d++) {
            double derivative = slope[d][exponents[d]];
            for (size_t v = 0; v < n; v++)
                if (v != d) derivative *= value[v][exponents[v]];
            dphi[d * n_terms + t] = (float)derivative;
        }
    }
}
