/* Maps with averaged derivatives: differences of maps over an interval of each parameter. */
#include "averaged_maps.h"

#include <math.h>
#include <string.h>

// ends[2]: the interval about the state over which the derivative by parameter k is averaged
static void interval(const fit_problem *p, size_t k, double ends[2])
{
    const double here = p->state.params[k];
    ends[0] = fmax(here - p->half_width[k], p->low[k]);
    ends[1] = fmin(here + p->half_width[k], p->high[k]);
}

sdm_status sdm_fit_averaged_maps(fit_problem *p, sdm_error *err)
{
    fit_maps *m = &p->maps;
    const size_t n = m->n_voxels, size = n * sizeof *m->values;
    // a network overwrites m->jacobian with every map: the means are collected in scratch memory
    float *before = (float *)m->spare, *mean = before + n;
    double params[FIT_PARAMS_MAX];
    memcpy(params, p->state.params, sizeof params);
    for (size_t k = 0; k < p->n_params; k++) {
        double ends[2];
        interval(p, k, ends);
        params[k] = ends[0];
        sdm_status s = sdm_fit_maps_make(m, params, false, err);
        memcpy(before, m->values, size);
        params[k] = ends[1];
        if (!s) s = sdm_fit_maps_make(m, params, false, err);
        if (s) return s;
        for (size_t v = 0; v < n; v++)
            mean[k * n + v] =
                (float)(((double)m->values[v] - (double)before[v]) / (ends[1] - ends[0]));
        params[k] = p->state.params[k];
    }
    const sdm_status s = sdm_fit_maps_make(m, params, false, err);
    memcpy(m->jacobian, mean, p->n_params * size);
    return s;
}
