/* Acceleration of fixed-point iterations. */
#ifndef FIT_MIXING_H
#define FIT_MIXING_H

#include "fit/data/problem.h"

enum { FIT_MIXING_DEPTH = 5, FIT_MIXING_MAX = FIT_UNKNOWNS_MAX + 3 * FIT_TISSUES_MAX };

/* The last points and their images; zero-initialise, and again where the map has changed. */
typedef struct fit_mixing {
    size_t count; // of pairs held, the newest last
    double point[FIT_MIXING_DEPTH + 1][FIT_MIXING_MAX], image[FIT_MIXING_DEPTH + 1][FIT_MIXING_MAX];
} fit_mixing;

/* x[n]: the point the map was asked at; y[n]: its image, replaced by a guess of the fixed point
   from up to `depth` pairs before that differs from it by `most` in no component. n <=
   FIT_MIXING_MAX, depth <= FIT_MIXING_DEPTH. */
void sdm_fit_mix(fit_mixing *m, size_t depth, size_t n, const double *x, double *y, double most);

#endif
