/* Test of a pose that was kept: likelihood ratio against a pose that is free. */
#include "kept_pose.h"

#include <math.h>
#include <stdio.h>

#include "fit/solver/objective.h"
#include "fit/solver/open_motions.h"
#include "kept_gain.h"

// *gain: of a free pose; *motion: rms motion of the surface along its normal by the change of the
// pose, mm. *p keeps the free pose
static sdm_status pose_free(fit_problem *p, double *gain, double *motion, sdm_error *err)
{
    const fit_state kept = p->state;
    sdm_fit_opts freed = *p->opts;
    freed.keep_pose = false;
    const sdm_status s = sdm_fit_free(p, &freed, sdm_fit_objective(p), gain, err);
    if (!s) *motion = sdm_fit_surface_motion(p, &kept);
    return s;
}

sdm_status sdm_fit_judge_kept_pose(fit_problem *p, sdm_fit_result *r, sdm_error *err)
{
    sdm_error failed = {0};
    r->kept_pose_gain = r->kept_pose_motion = NAN;
    const sdm_status s = pose_free(p, &r->kept_pose_gain, &r->kept_pose_motion, &failed);
    if (s == SDM_E_NOMEM || s == SDM_E_CANCELLED) return sdm_fail(err, s, "%s", failed.text);
    const double motion_max = FIT_FREE_MOTION_MAX * fit_longest_edge(&p->maps.grid);
    if (!(r->kept_pose_gain > FIT_FREE_GAIN_MAX && r->kept_pose_motion > motion_max)) return SDM_OK;
    sdm_fit_finding f = {.kind = SDM_FIT_CHECK_KEPT_POSE,
                         .grade = SDM_FIT_FAILED,
                         .figure = r->kept_pose_gain,
                         .limit = FIT_FREE_GAIN_MAX};
    snprintf(f.text, sizeof f.text,
             "the kept pose does not match the data: free, it moves the surface by %.2g mm and "
             "explains the data better by %.3g (log-likelihood of independent samples); correct "
             "the pose, or do not keep it",
             r->kept_pose_motion, r->kept_pose_gain);
    sdm_fit_verdict_add(&r->verdict, &f);
    return sdm_fail(err, SDM_E_QUALITY, "%s", f.text);
}
