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

// memory for the means of the derivatives, and before it for a map: a network overwrites
// m->jacobian with every map
static float *scratch_of(const fit_maps *m) { return (float *)m->spare; }

static void map_keep(const fit_maps *m)
{
    memcpy(scratch_of(m), m->values, m->n_voxels * sizeof *m->values);
}

// the mean derivative by parameter k, from the map that was kept and the latest one
static void mean_set(const fit_maps *m, size_t k, double width)
{
    const float *before = scratch_of(m);
    float *mean = scratch_of(m) + m->n_voxels * (k + 1);
    for (size_t v = 0; v < m->n_voxels; v++)
        mean[v] = (float)(((double)m->values[v] - (double)before[v]) / width);
}

static void means_take(const fit_maps *m)
{
    memcpy(m->jacobian, scratch_of(m) + m->n_voxels,
           m->n_params * m->n_voxels * sizeof *m->jacobian);
}

sdm_status sdm_fit_averaged_maps(fit_problem *p, sdm_error *err)
{
    fit_maps *m = &p->maps;
    double params[FIT_PARAMS_MAX];
    memcpy(params, p->state.params, sizeof params);
    for (size_t k = 0; k < p->n_params; k++) {
        double ends[2];
        interval(p, k, ends);
        params[k] = ends[0];
        sdm_status s = sdm_fit_maps_make(m, params, false, err);
        if (s) return s;
        for (const fit_maps *one = m; one; one = one->between) map_keep(one);
        params[k] = ends[1];
        s = sdm_fit_maps_make(m, params, false, err);
        if (s) return s;
        for (const fit_maps *one = m; one; one = one->between) mean_set(one, k, ends[1] - ends[0]);
        params[k] = p->state.params[k];
    }
    const sdm_status s = sdm_fit_maps_make(m, params, false, err);
    if (s) return s;
    for (const fit_maps *one = m; one; one = one->between) means_take(one);
    return SDM_OK;
}
