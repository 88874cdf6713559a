/* Order statistics of numbers. */
#pragma once

#include <stddef.h>

/* Sorts x[n], the smallest first. */
void cli_sort(double *x, size_t n);

/* Sorts x[n], n > 0, and returns its median, for an even n the mean of the middle two. */
double cli_median(double *x, size_t n);
