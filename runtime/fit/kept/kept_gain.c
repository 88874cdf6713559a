/* Likelihood ratio of unknowns that are free against the same ones kept. The free fit gives the
 * noise, since with wrong values the residuals are correlated and large. */
#include "kept_gain.h"

#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/trust/posterior.h"

// largest number of iterations, and their eps: a rough maximum is enough
#define ITERATIONS 25
#define EPS 1e-3

sdm_status sdm_fit_free(fit_problem *p, const sdm_fit_opts *freed, double kept, double *gain,
                        sdm_error *err)
{
    const sdm_fit_opts *given = p->opts;
    sdm_fit_opts silent = *freed;
    const fit_newton_opts newton = {.phase = SDM_FIT_SEARCH,
                                    .keep_params = freed->keep_params,
                                    .keep_pose = freed->keep_pose,
                                    .keep_blur = freed->keep_blur,
                                    .keep_appearance = freed->keep_appearance,
                                    .max_iterations = ITERATIONS,
                                    .eps = EPS,
                                    .max_flat = 2};
    fit_newton_end end;
    double weight[FIT_UNKNOWNS_MAX], noise_factor;
    silent.progress = NULL;
    p->opts = &silent;
    sdm_status s = sdm_fit_newton(p, &newton, &end, err);
    if (!s) s = sdm_fit_weigh_priors(p, weight, &noise_factor, err);
    if (!s) *gain = (sdm_fit_objective(p) - kept) / noise_factor;
    p->opts = given;
    return s;
}
