/* Trilinear interpolation in a map. */
#include "trilinear.h"

#include <math.h>
#include <stddef.h>

double trainer_trilinear(const sdm_grid *g, const float *map, const double index[3])
{
    size_t at[3];
    double share[3], sum = 0;
    for (int a = 0; a < 3; a++) {
        at[a] = g->n[a] > 1 ? (size_t)fmin(index[a], (double)g->n[a] - 2) : 0;
        share[a] = index[a] - (double)at[a];
    }
    for (int k = 0; k < 8; k++) {
        double weight = 1;
        size_t v[3];
        for (int a = 0; a < 3; a++) {
            const int bit = k >> a & 1;
            weight *= bit ? share[a] : 1 - share[a];
            v[a] = at[a] + (size_t)(bit && g->n[a] > 1);
        }
        sum += weight * (double)map[(v[2] * (size_t)g->n[1] + v[1]) * (size_t)g->n[0] + v[0]];
    }
    return sum;
}
