/* Order statistics of numbers. */
#include "median.h"

#include <stdlib.h>

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

void cli_sort(double *x, size_t n) { qsort(x, n, sizeof *x, ascending); }

double cli_median(double *x, size_t n)
{
    cli_sort(x, n);
    return n % 2 ? x[n / 2] : 0.5 * (x[n / 2 - 1] + x[n / 2]);
}
