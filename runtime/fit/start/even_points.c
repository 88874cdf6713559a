/* Searches from the estimate of a fit to points for the shape on whose surface the points lie most
 * evenly. */
#include "even_points.h"

#include <math.h>

#include "fit/solver/newton.h"

// the deviation of the points starts at this share of the reach of the shape and shrinks by this
// factor, down to this multiple of the estimate
#define WIDEST 0.1
#define SHRINK 0.6
#define NARROWEST 3.0
// largest number of iterations with each deviation
#define STEPS 4
// smallest change of a parameter that counts, as a share of its range
#define STEP_LEAST 0.01

sdm_status sdm_fit_even_points(fit_problem *p, bool *moved, sdm_error *err)
{
    const fit_state from = p->state;
    const fit_newton_opts newton = {.phase = SDM_FIT_SEARCH,
                                    .keep_pose = p->opts->keep_pose,
                                    .keep_blur = true,
                                    .keep_appearance = true,
                                    .max_iterations = STEPS,
                                    .eps = 0.1 * STEP_LEAST};
    fit_newton_end end;
    *moved = false;
    p->n_even = 0;
    for (size_t i = 0; i < p->samples.n; i++)
        p->n_even += sdm_fit_point_belongs(&p->observation, p->samples.field[i]);
    sdm_status s = SDM_OK;
    for (double sd = fmax(WIDEST * p->extent.reach, NARROWEST * from.point_sd);
         sd >= NARROWEST * from.point_sd && !s; sd *= SHRINK) {
        p->state.point_sd = sd;
        s = sdm_fit_newton(p, &newton, &end, err);
    }
    p->n_even = 0;
    p->state.point_sd = from.point_sd;
    for (size_t k = 0; k < p->n_params; k++) {
        const double range = p->high[k] - p->low[k];
        *moved = *moved || fabs(p->state.params[k] - from.params[k]) > STEP_LEAST * range;
    }
    return s;
}
