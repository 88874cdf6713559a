/* Test of a pose that was kept: likelihood ratio against a pose that is free. The free fit gives
 * the noise, since in a wrong pose the residuals are correlated and large. */
#include "kept_pose.h"

#include <math.h>

#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "posterior.h"

// largest number of iterations, and their eps: a rough maximum is enough
#define ITERATIONS 25
#define EPS 1e-3

sdm_status sdm_fit_kept_pose_test(fit_problem *p, double *gain, double *motion, sdm_error *err)
{
    const sdm_fit_opts *given = p->opts;
    sdm_fit_opts freed = *given;
    const fit_state kept = p->state;
    const double before = sdm_fit_objective(p), noise_factor = p->noise_factor;
    const fit_newton_opts newton = {.phase = SDM_FIT_SEARCH,
                                    .keep_params = given->keep_params,
                                    .keep_blur = given->keep_blur,
                                    .keep_appearance = given->keep_appearance,
                                    .max_iterations = ITERATIONS,
                                    .eps = EPS,
                                    .max_flat = 2};
    fit_newton_end end;
    double weight[FIT_PARAMS_MAX + 6];
    freed.keep_pose = false;
    freed.progress = NULL;
    p->opts = &freed;
    sdm_status s = sdm_fit_newton(p, &newton, &end, err);
    const double after = s ? before : sdm_fit_objective(p);
    if (!s) s = sdm_fit_weigh_priors(p, weight, &p->noise_factor, err);
    *gain = (after - before) / p->noise_factor;
    *motion = s ? 0 : sdm_fit_surface_motion(p, &kept);
    // back
    p->opts = given;
    p->state = kept;
    p->noise_factor = noise_factor;
    return s ? s : sdm_fit_evaluate(p, err);
}
