/* Newton's method: from a state to the nearest maximum of the posterior. */
#pragma once

#include "problem.h"

/* sdm_fit_opts.max_iterations by default */
enum { FIT_ITERATIONS_USUAL = 60 };

/* Which unknowns move, how steps are made and when the iterations end. */
typedef struct fit_newton_opts {
    /* reported to sdm_fit_opts.progress; also sets the initial damping */
    sdm_fit_phase phase;
    /* groups of unknowns that keep their values */
    bool keep_params, keep_pose, keep_blur, keep_appearance;
    /* >= 1 */
    size_t max_iterations;
    /* converged when the largest step is at most eps, in the units of sdm_fit_opts.eps */
    double eps;
    /* converged, too, when an undamped step would move no unknown by more than this share of its
     * standard deviation; 0: never */
    double eps_sd;
    /* > 0: this number of flat steps (negligible predicted gain) in a row also ends the iterations;
     * 0: they do not */
    int max_flat;
    /* derivatives are averaged, see sdm_fit_averaging_begin() */
    bool averaged;
} fit_newton_opts;

/* How the iterations ended. */
typedef struct fit_newton_end {
    bool converged;
    /* the iterations ended because of eps_sd (small) or of max_flat (flat), before the size of the
       steps fell to eps */
    bool small, flat;
    /* not converged, but steps that went to and fro were scaled down until they moved no unknown by
       more than a small share of its standard deviation; see sdm_fit_accept_small_steps() */
    bool at_rest;
    /* size of the last step, in the units of sdm_fit_opts.eps */
    double step;
} fit_newton_end;

/* Moves problem->state by iterations towards the maximum, and leaves *problem evaluated at the last
   state. Each iteration re-estimates the tissues and takes one step in the other unknowns: damped
   (Levenberg 1944, Marquardt 1963) far from the maximum, Anderson-accelerated near it. Averaged
   steps that go to and fro are scaled down. *out: how the iterations ended; reaching max_iterations
   is no error. */
sdm_status sdm_fit_newton(fit_problem *p, const fit_newton_opts *opts, fit_newton_end *out,
                          sdm_error *err);

/* Calls sdm_fit_opts.progress, if there is one, with the state of *p. step: as in sdm_fit_progress.
 */
void sdm_fit_tell_progress(const fit_problem *p, sdm_fit_phase phase, double step);

/* *to = *from moved by step[information.n_unknowns]: parameters are clamped to their bounds; the
   rotation step (rad) is a rotation vector about the world's axes, applied after the pose. */
void sdm_fit_state_move(const fit_problem *p, const fit_state *from, const double *step,
                        fit_state *to);
