/* What a fit gains if unknowns that were kept are free. */
#pragma once

#include "fit/solver/problem.h"

/* Kept values refuse a fit if free ones gain more than this (true values exceed it once in a
   million times), and move the surface by more than this part of a voxel of the map. */
#define FIT_FREE_GAIN_MAX 20.0
#define FIT_FREE_MOTION_MAX 0.5

/* Goes on from the state of *p, which must be evaluated, to a rough maximum of the posterior with
   the options `freed` in place of p->opts, which stay. *gain: gain in log posterior density over
   that of the kept values, `kept`, as of independent samples. *p keeps the new state. Errors of
   sdm_fit_newton(). */
sdm_status sdm_fit_free(fit_problem *p, const sdm_fit_opts *freed, double kept, double *gain,
                        sdm_error *err);
