/* The second grid of the maps. */
#include "between.h"

#include <math.h>

#include "information.h"
#include "objective.h"
#include "sdm/internal/heap.h"

// difference in log-likelihood, as of independent samples, by which the place of the grid counts
#define PLACE_COUNTS 1.0

sdm_status sdm_fit_between_add(fit_problem *p, bool *added, sdm_error *err)
{
    *added = false;
    if (!p->maps.share || p->maps.between) return SDM_OK;
    sdm_status s = sdm_fit_maps_between_begin(&p->maps, p->opts, err);
    if (!s) s = sdm_fit_maps_between_make(&p->maps, p->state.params, false, err);
    if (!s) {
        fit_maps *between = p->maps.between;
        sdm_fit_maps_pack(between, sdm_fit_field_blur(p), false);
        const double there = sdm_fit_samples_log_likelihood(&p->samples, between, &p->observation,
                                                            &p->state),
                     here = p->information.log_likelihood;
        *added = fabs(here - there) > PLACE_COUNTS * p->noise_factor;
    }
    if (*added)
        p->maps_params[0] = p->maps_blur = NAN;
    else
        sdm_fit_maps_between_end(&p->maps);
    return s;
}
