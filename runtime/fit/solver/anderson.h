/* Anderson acceleration of fixed-point iterations x -> g(x). */
#pragma once

#include "fit/data/unknowns.h"

enum {
    /* largest number of earlier pairs that are combined */
    FIT_ANDERSON_DEPTH = 5,
    /* largest number of components of a point: all unknowns, and three numbers for each tissue */
    FIT_ANDERSON_MAX = FIT_UNKNOWNS_MAX + 3 * FIT_TISSUES_MAX
};

/* The last `count` points x and their images g(x), the newest last. Zero-initialise; set count = 0
   where g has changed. */
typedef struct fit_anderson {
    size_t count;
    double point[FIT_ANDERSON_DEPTH + 1][FIT_ANDERSON_MAX];
    double image[FIT_ANDERSON_DEPTH + 1][FIT_ANDERSON_MAX];
} fit_anderson;

/* Stores the pair x[n], y[n] = g(x) and replaces y by an estimate of the fixed point from it and up
   to `depth` earlier pairs. The whole change of y is scaled down such that no component changes by
   more than max_change. n <= FIT_ANDERSON_MAX, depth <= FIT_ANDERSON_DEPTH. */
void sdm_fit_anderson_mix(fit_anderson *m, size_t depth, size_t n, const double *x, double *y,
                          double max_change);
