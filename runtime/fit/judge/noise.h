/* Noise by robust statistics, which a minority of wrong values does not change. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

/* Median of x[n], whose order changes; NaN for n = 0. */
double sdm_fit_median(double *x, size_t n);

/* Standard deviation of Gaussian values with the same median of absolute deviations from `centre`
   (Hampel 1974). Overwrites x[n]; NaN for n = 0. */
double sdm_fit_robust_sd(double *x, size_t n, double centre);

/* Middle of the shortest interval that holds half of x[n], the least median of squares estimate of
   a location (Rousseeuw 1984): where the values have two modes, it lies in the larger one. *sd:
   standard deviation of Gaussian values with an interval of this length. Sorts x; NaN for n = 0. */
double sdm_fit_shortest_half(double *x, size_t n, double *sd);

/* Correlation of two neighbours whose values have the sd 1, from their n differences d: 1 - var(d)
   / 2, with a robust variance of the differences (a robust variogram: Cressie and Hawkins 1980,
   Genton 1998), but 0 .. 1. Overwrites d[n]; NaN for fewer than 30 of them. */
double sdm_fit_robust_correlation(double *d, size_t n);
