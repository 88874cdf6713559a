/* Rivals of a fit: other explanations of the same samples. How much better the fitted shape is than
 * one of them, in units of log-likelihood of independent samples. */
#pragma once

#include "misfit.h"

/* How well a shape explains the samples. */
typedef struct fit_standing {
    /* images and points: log-likelihood, and the number of correlated samples that count as one
     * independent one; labels: 0 */
    double log_likelihood, factor;
    /* labels and points: number of neighbourhoods (0: too few points to tell, fit_misfit.few, so
     * that their likelihood decides), and their mean (mean residual)^2 / variance of the noise;
     * images: 0 */
    size_t n_units;
    double chi_square;
    size_t n_points; /* points: number of them that are no strays; else 0 */
} fit_standing;

/* Fills *out from p->samples and p->information. factor: as fit_standing. SDM_E_NOMEM. */
sdm_status sdm_fit_stand(const fit_problem *p, double factor, fit_standing *out, sdm_error *err);

/* chi_square of one standing beside another on the same samples: points that it alone takes for
 * strays count with residuals of 3 deviations. */
double sdm_fit_chi_square(const fit_standing *s, const fit_standing *against);

/* Whether both have enough neighbourhoods, of labels or points, for a gain by their residuals. */
bool sdm_fit_has_units(const fit_standing *fit, const fit_standing *rival);

/* Gain of the fit over a rival that was measured on the same samples: of labels and points from
   sdm_fit_chi_square() of both, of images and of points with few neighbourhoods from the
   likelihood. A rival of points that is less likely has no gain over the fit; where it is less
   likely by 30 or more, the larger gain of the fit counts. NaN: labels have no neighbourhoods. */
double sdm_fit_gain(const fit_standing *fit, const fit_standing *rival);

/* Log-likelihood ratio of mean residuals of n neighbourhoods whose common variance is estimated. */
double sdm_fit_units_gain(double n, double chi_square, double rival_chi_square);

/* True if the image tells neither surface from the other, nor from the surface half-way between
   them: their log-likelihoods differ by less than SDM_FIT_PREFERRED, and the mean of their shares
   explains the voxels as well, neither much worse nor much better: between two maxima lies a
   valley, and where the image shows both surfaces their mean explains more than each. Poses and
   parameters are not compared, so that symmetries of the shape do not count.

   fit, rival: the standings on the same samples; field[n]: the share of the fit at the samples;
   the one of the rival, with its tissues, is in problem->samples. */
bool sdm_fit_same_maximum(const fit_problem *p, const fit_standing *fit, const double *field,
                          const fit_standing *rival);

/* True if the fit began, at first or at a restart, about where the rival is: with its value of
   parameter param - 1 or, for param 0, in its pose. A fit that starts there would end as this one
   has. centre: middle of the shape, in its frame, mm. */
bool sdm_fit_began_at(const fit_problem *p, const fit_state *fitted, const fit_state *rival,
                      size_t param, const double centre[3]);

/* True if the rival differs from the fit along open directions alone: it turns about an axis, or
   shifts along one, for which the covariance of *r has a standard deviation above half a radian or
   half the reach of the shape, and the rest of its pose and its parameters differ by no more than
   their standard deviations allow. centre: as above. */
bool sdm_fit_differs_openly(const fit_problem *p, const sdm_fit_result *r, const fit_state *fitted,
                            const fit_state *rival, const double centre[3]);
