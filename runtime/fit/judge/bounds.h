/* Parameters that end at a bound of their range, and whether the data want them beyond it. */
#pragma once

#include "fit/solver/problem.h"

/* Parameters at their bounds. */
typedef struct fit_at_bounds {
    /* number of them, and of those of which the data want more (or less) */
    size_t n, n_wanted;
    /* their names, "base, height"; those without room left out */
    char names[100];
    /* "base ends at its bound: the data want more than 60, the largest value of its range", of
       the parameter that the data want farthest beyond; else "" */
    char text[320];
    /* where they want none clearly: "the data may want base to be more than 60, the largest value
       of its range", of the parameter that the likelihood pushes hardest against its bound; else ""
     */
    char hint[160];
    /* the data are longer or shorter than the shape by a length that this parameter would explain:
       `text` says how large it would have to be */
    bool measured;
    /* this length is more than 5 % of the shape's, and the likelihood wants the parameter beyond
       its bound as well: the estimate is wrong, however well the rest matches */
    bool far;
} fit_at_bounds;

/* Looks at the derivative of the log-likelihood at the estimate *r. The data want a parameter
 * beyond its bound if the Newton step of this parameter alone would gain more than
 * SDM_FIT_PREFERRED in log-likelihood of independent samples; factor: number of correlated samples
 * that count as one. */
fit_at_bounds sdm_fit_at_bounds(const fit_problem *p, const sdm_fit_result *r, double factor);

/* Labels and points: compares the length of the data along the axes of the shape with that of the
 * shape, and with the derivative of the latter by a parameter at its bound. Far from the shape the
 * likelihood says nothing: labels beyond the margin do not count, points pass for outliers. If
 * another value of the parameter explains the difference, sets b->measured, b->text and, at least
 * to 1, b->n_wanted. The maps must hold voxels (sdm_fit_maps_voxels()). SDM_E_NOMEM. */
sdm_status sdm_fit_measure_beyond(const fit_problem *p, const sdm_fit_result *r, fit_at_bounds *b,
                                  sdm_error *err);
