/* See creases.h. */
#include "averaged_gradient.h"

#include <math.h>

// so far the surface moves on the way (rms, voxels of the map): over many kinks, and little beside
// what an image tells
#define MOTION 0.03
// share of a parameter's range at most
#define WAY_MOST 0.05

void sdm_fit_ways(const fit_problem *p, double *way)
{
    const fit_maps *m = &p->maps;
    const double *h = m->grid.spacing, step = fmax(h[0], fmax(h[1], h[2]));
    for (size_t k = 0; k < p->n_params; k++) {
        double sum = 0, n = 0;
        for (size_t v = 0; v < m->n_voxels; v++) {
            if (fabs(m->distance[v]) > step) continue;
            sum +=
                (double)m->jacobian[k * m->n_voxels + v] * (double)m->jacobian[k * m->n_voxels + v];
            n++;
        }
        const double range = p->high[k] - p->low[k];
        way[k] = fmin(n > 0 && sum > 0 ? MOTION * step / sqrt(sum / n) : range, WAY_MOST * range);
    }
}

sdm_status sdm_fit_average_gradient(fit_problem *p, const double *way, sdm_error *err)
{
    double params[FIT_PARAMS_MAX];
    for (size_t k = 0; k < p->n_params; k++) params[k] = p->state.params[k];
    for (size_t k = 0; k < p->n_params; k++) {
        const double here = params[k], low = fmax(here - way[k], p->low[k]),
                     high = fmin(here + way[k], p->high[k]);
        double before, after;
        params[k] = low;
        sdm_status s = sdm_fit_value(p, params, &before, err);
        params[k] = high;
        if (!s) s = sdm_fit_value(p, params, &after, err);
        if (s) return s;
        p->sums.gradient[k] = (after - before) / (high - low);
        params[k] = here;
    }
    return SDM_OK;
}
