/* Lower envelope of parabolas along a line of samples. */
#include "sdm/internal/envelope.h"

#include <math.h>

void sdm_lower_envelope(double *f, int64_t n, double spacing, double *scratch)
{
    // parabola m of the envelope: position of its minimum, value there, and start of the interval
    // in which it is the lowest
    double *site = scratch, *from = site + n, *height = from + n;
    const double square = spacing * spacing;
    int64_t m = 0;
    for (int64_t i = 0; i < n; i++) {
        if (f[i] == INFINITY) continue;
        const double x = (double)i;
        double start = -INFINITY;
        while (m > 0) {
            // intersection of the new parabola with the last one; right of it the new one is lower
            start = 0.5 * (x + site[m - 1] + (f[i] - height[m - 1]) / (square * (x - site[m - 1])));
            if (start > from[m - 1]) break;
            m--;
            start = -INFINITY;
        }
        site[m] = x;
        height[m] = f[i];
        from[m++] = start;
    }
    if (!m) return;
    for (int64_t i = 0, k = 0; i < n; i++) {
        while (k + 1 < m && from[k + 1] <= (double)i) k++;
        const double d = (double)i - site[k];
        f[i] = height[k] + square * d * d;
    }
}
