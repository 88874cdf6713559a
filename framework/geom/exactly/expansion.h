/* Exact sums of doubles as expansions (Shewchuk 1997): an expansion e[n] is an unevaluated sum of n
 * doubles whose bits do not overlap, ordered from the smallest to the largest magnitude. */
#pragma once

#include <math.h>

/* Adds b to the expansion e[n]; returns its new length, at most n + 1. */
static inline int sdm_expansion_add(double *e, int n, double b)
{
    double q = b;
    int m = 0;
    for (int i = 0; i < n; i++) {
        const double sum = q + e[i];
        const double part = sum - q;
        const double rest = (q - (sum - part)) + (e[i] - part);
        q = sum;
        if (rest != 0) e[m++] = rest;
    }
    if (q != 0) e[m++] = q;
    return m;
}

/* Adds the exact product a * b to the expansion e[n]; returns its new length, at most n + 2. */
static inline int sdm_expansion_add_product(double *e, int n, double a, double b)
{
    const double high = a * b;
    n = sdm_expansion_add(e, n, fma(a, b, -high));
    return sdm_expansion_add(e, n, high);
}

/* Sign of the sum, -1, 0 or 1: the sign of the largest component. */
static inline int sdm_expansion_sign(const double *e, int n)
{
    return n == 0 ? 0 : e[n - 1] > 0 ? 1 : -1;
}
