/* Correlation of neighbouring residuals. C[FIT_LAG_MIDDLE + 1]: of half of the lags and of none,
 * the last. */
#ifndef FIT_CORRELATION_H
#define FIT_CORRELATION_H

#include "neighbours.h"

/* C(lag) = E[e_n e_(n+lag)] as the residuals are, and the half width of the window of lags that
   stand out. effort: part of the pairs that are taken. The same bits for any number of threads, as
   below. */
sdm_status sdm_fit_correlate(const fit_shell *v, double effort, int n_threads, double *c,
                             int *width, sdm_error *err);

/* The same of the errors themselves: residuals are about the fit, which has taken from them what it
   could explain, most of all what is alike over many voxels. influence[n_unknowns][n_unknowns]:
   inverse of the information, 0 for what was kept. */
sdm_status sdm_fit_free_correlation(const fit_shell *v, const double *influence, int width,
                                    int n_threads, double *c, sdm_error *err);

/* weighted[]: correlations in a window, whose weights are 1 in its inner half where `flat`; returns
 * their sum over all lags, at least C(0). */
double sdm_fit_weigh_lags(const double *c, int width, bool flat, double *weighted);

#endif
