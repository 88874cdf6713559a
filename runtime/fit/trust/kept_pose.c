/* Test of a pose that was kept: likelihood ratio against a pose that is free. The free fit gives
 * the noise, since in a wrong pose the residuals are correlated and large. */
#include "kept_pose.h"

#include <math.h>
#include <stdio.h>

#include "fit/solver/newton.h"
#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "posterior.h"

// largest number of iterations, and their eps: a rough maximum is enough
#define ITERATIONS 25
#define EPS 1e-3
// a kept pose is refused if a free one gains more than this (the true one exceeds it once in a
// million times), and moves the surface by more than this part of a voxel of the map
#define GAIN_MAX 20.0
#define MOTION_MAX 0.5

// *gain: gain in log posterior density by a free pose, as of independent samples; *motion: rms
// motion of the surface along its normal by the change of the pose, mm. *p keeps the free pose
static sdm_status pose_free(fit_problem *p, double *gain, double *motion, sdm_error *err)
{
    const sdm_fit_opts *given = p->opts;
    sdm_fit_opts freed = *given;
    const fit_state kept = p->state;
    const double before = sdm_fit_objective(p);
    const fit_newton_opts newton = {.phase = SDM_FIT_SEARCH,
                                    .keep_params = given->keep_params,
                                    .keep_blur = given->keep_blur,
                                    .keep_appearance = given->keep_appearance,
                                    .max_iterations = ITERATIONS,
                                    .eps = EPS,
                                    .max_flat = 2};
    fit_newton_end end;
    double weight[FIT_PARAMS_MAX + 6], noise_factor;
    freed.keep_pose = false;
    freed.progress = NULL;
    p->opts = &freed;
    sdm_status s = sdm_fit_newton(p, &newton, &end, err);
    if (!s) s = sdm_fit_weigh_priors(p, weight, &noise_factor, err);
    if (!s) {
        *gain = (sdm_fit_objective(p) - before) / noise_factor;
        *motion = sdm_fit_surface_motion(p, &kept);
    }
    p->opts = given;
    return s;
}

sdm_status sdm_fit_judge_kept_pose(fit_problem *p, sdm_fit_result *r, sdm_error *err)
{
    sdm_error failed = {0};
    r->kept_pose_gain = r->kept_pose_motion = NAN;
    const sdm_status s = pose_free(p, &r->kept_pose_gain, &r->kept_pose_motion, &failed);
    if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return sdm_fail(err, s, "%s", failed.text);
    const double motion_max = MOTION_MAX * fit_longest_edge(&p->maps.grid);
    if (!(r->kept_pose_gain > GAIN_MAX && r->kept_pose_motion > motion_max)) return SDM_OK;
    sdm_fit_finding f = {.kind = SDM_FIT_CHECK_KEPT_POSE,
                         .grade = SDM_FIT_FAILED,
                         .figure = r->kept_pose_gain,
                         .limit = GAIN_MAX};
    snprintf(f.text, sizeof f.text,
             "the kept pose does not match the data: free, it moves the surface by %.2g mm and "
             "explains the data better by %.3g (log-likelihood of independent samples); correct "
             "the pose, or do not keep it",
             r->kept_pose_motion, r->kept_pose_gain);
    sdm_fit_verdict_add(&r->verdict, &f);
    return sdm_fail(err, SDM_E_QUALITY, "%s", f.text);
}
