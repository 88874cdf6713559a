/* Errors that neighbouring points of a fit share. Where the shape is right and the points err
   independently, two neighbours differ as much as any two points do. Where neighbours agree and
   still lie off the surface, their errors are systematic: the shape differs from the object, or the
   scanner errs alike over neighbouring points. The points alone do not tell which of both. */
#pragma once

#include "fit/solver/problem.h"

typedef struct fit_shared_errors {
    size_t n;     /* number of points whose nearest neighbours are compared; 0: too few to tell */
    double all;   /* root mean square distance of the points from the surface, mm */
    double near;  /* scatter of neighbouring points: the root of half of the mean square difference
                     of nearest neighbours, mm */
    double ratio; /* all^2 / the larger of near^2 and facets^2; 1: the errors are independent, up to
                     chance */
    double limit; /* where half of all^2 is shared, a larger ratio occurs once in a thousand fits */
} fit_shared_errors;

/* foot[3] = the foot of point i, mm: the nearest place on the surface, to first order (the point
   less its distance along the gradient). */
void sdm_fit_foot(const fit_problem *p, size_t i, double foot[3]);

/* Compares n points. place[n], foot[n], distance[n]: mm. facets: standard deviation of errors of
   the surface itself, mm. Neighbours are found by the feet, which no error across the surface
   changes: points that scatter farther than they are apart have neighbours of the same error as
   they lie. Where they lie farther apart, neighbours are also found by their places, and the
   smaller scatter of both counts: at an edge the feet of points that are far off the surface lie
   together. */
void sdm_fit_shared_errors_of(const double (*place)[3], const double (*foot)[3],
                              const double *distance, size_t n, double facets,
                              fit_shared_errors *out);

/* The same of the points of a fit that belong to the surface: used[samples]. SDM_E_NOMEM. */
sdm_status sdm_fit_shared_errors(const fit_problem *p, const bool *used, fit_shared_errors *out,
                                 sdm_error *err);
