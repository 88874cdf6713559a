/* Lower envelope of parabolas along a line of samples. */
#include "sdm/internal/envelope.h"

#include <math.h>

void sdm_lower_envelope(double *f, int64_t n, double spacing, double *scratch)
{
    // for parabola k of the envelope: site[k] = position of its minimum, height[k] = value there,
    // from[k] = start of the interval in which it is the lowest
    double *site = scratch, *from = site + n, *height = from + n;
    const double square = spacing * spacing;
    int64_t m = 0;
    for (int64_t i = 0; i < n; i++) {
        if (f[i] == INFINITY) continue;
        const double x = (double)i;
        double start = -INFINITY;
        while (m > 0) {
            // the new parabola intersects the last one at `start` and is lower to the right of it
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
