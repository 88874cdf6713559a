/* Points far off the fitted surface that lie together. A robust fit takes no notice of them, and
 * they are too few for a surface of their own. Outliers anywhere have neighbours on the surface;
 * where the shape is wrong in a small region, the neighbours lie off the surface as well, on the
 * same side. */
#pragma once

#include "fit/solver/problem.h"

/* Points of a fit and their distances from its surface. */
typedef struct fit_distances {
    size_t n;
    double (*x)[3];   /* [n] mm */
    double *distance; /* [n] mm, negative inside */
    double far;       /* points beyond this distance are outlying, mm */
} fit_distances;

/* Groups of outlying points. */
typedef struct fit_groups {
    size_t n;       /* number of points in all groups */
    size_t largest; /* number of points of the largest group; 0: there is none */
    size_t least;   /* smaller groups do not count */
    /* of the largest group: its centre, mean distance from the surface, smallest and largest
     * absolute one, mm */
    double centre[3], mean, nearest, farthest;
} fit_groups;

/* Finds the groups. A point belongs to one if more of its nearest points are outlying on its side
   than chance explains once in a thousand fits: outliers at any places of the surface, as many as
   there are outside of the group. SDM_E_NOMEM. */
sdm_status sdm_fit_groups_find(const fit_distances *t, fit_groups *g, sdm_error *err);

/* Doubts the check "patch" of a fit to points, which has passed, if there are such groups.
 * SDM_E_NOMEM. */
sdm_status sdm_fit_check_outlying(const fit_problem *p, sdm_fit_verdict *v, sdm_error *err);
