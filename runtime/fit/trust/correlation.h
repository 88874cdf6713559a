/* Autocorrelation of the residuals over lags, displacements between voxels.

   An array c[FIT_LAG_ZERO + 1] holds C(lag) for one half of all lags and, as its last element, for
   lag zero; C(-lag) = C(lag). Functions give the same bits for any number of threads. */
#pragma once

#include "neighbours.h"

/* c: C(lag) = mean of e_n e_(n+lag) of the residuals e, weighted; C(0), the variance of residuals,
   is about 1. *width: half width, in steps, of the window of lags whose correlations stand out from
   their error; c is 0 beyond the lags that were examined. effort, 0 .. 1: part of the voxel pairs
   that is used. n_threads >= 1.

   *freedom: degrees of freedom of the sum of the correlations in the window, number of voxels over
   sum of the squared weights of the lags (Priestley 1981): its relative variance is 2 / *freedom.
 */
sdm_status sdm_fit_correlation_estimate(const fit_neighbours *v, double effort, int n_threads,
                                        double *c, int *width, double *freedom, sdm_error *err);

/* Turns c from the autocorrelation of the residuals into that of the errors. Residuals are errors
   less the part that the fit could explain, mostly the part that is constant over many voxels, so
   their correlations are too small. influence[n_unknowns][n_unknowns]: inverse of the information,
   0 for unknowns that were kept. */
sdm_status sdm_fit_correlation_correct(const fit_neighbours *v, const double *influence, int width,
                                       int n_threads, double *c, sdm_error *err);

/* tapered[FIT_LAG_ZERO + 1] = c times a window over lags. flat: weight 1 up to lag width / 2, then
   falling linearly to 0 just past `width`; else falling linearly from lag zero. Returns the sum
   over all lags and their opposites (c stores one of each pair), but at least C(0). */
double sdm_fit_correlation_taper(const double *c, int width, bool flat, double *tapered);
