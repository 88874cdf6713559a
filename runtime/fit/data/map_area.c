/* Area of the surface on a map: the sum of a smooth delta function of the distance. */
#include "map_area.h"

#include <string.h>

// half width of the delta function, in voxels
#define HALF_WIDTH 1.5
#define PI 3.14159265358979323846

void sdm_fit_maps_area(const fit_maps *m, double *area, double *gradient)
{
    const double *h = m->grid.spacing, volume = h[0] * h[1] * h[2],
                 half = HALF_WIDTH * fit_longest_edge(&m->grid);
    *area = 0;
    memset(gradient, 0, m->n_params * sizeof *gradient);
    for (size_t v = 0; v < m->n_voxels; v++) {
        const double x = m->distance[v] / half;
        if (!(fabs(x) < 1)) continue;
        const double slope = -PI * sin(PI * x) / (2 * half * half);
        *area += volume * (1 + cos(PI * x)) / (2 * half);
        for (size_t k = 0; k < m->n_params; k++)
            gradient[k] += volume * slope * (double)m->jacobian[k * m->n_voxels + v];
    }
}
