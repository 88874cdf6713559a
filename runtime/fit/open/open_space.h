/* The space beyond the open end of a shape, where an image is no evidence about the shape. It is
 * the part of a ball about the opening that lies beyond the plane of the opening, with a soft
 * border. */
#pragma once

#include "sdm/registry.h"

/* The space depends on seven numbers: centre[3], outward[3] and radius of the opening. */
enum { FIT_OPEN_NUMBERS = 7 };

typedef struct fit_open_end {
    /* shape's frame, mm; the normal has length 1 and points away from the shape */
    double centre[3], outward[3], radius;
    /* mm: the ball reaches so much farther than the opening */
    double margin;
} fit_open_end;

/* *out = the space beyond the open end of the shape at params[n_params]. Errors of
   sdm_instance_open_end(). */
sdm_status sdm_fit_open_end_make(const sdm_instance *shape, const double *params, double margin,
                                 fit_open_end *out, sdm_error *err);

/* slopes[n_params] = derivatives of the numbers by each parameter, as differences within its range.
   params[n_params] change during the call. Errors of sdm_instance_open_end(). */
sdm_status sdm_fit_open_end_slopes(const sdm_instance *shape, double *params,
                                   double (*slopes)[FIT_OPEN_NUMBERS], sdm_error *err);

/* Returns how far the point y (shape's frame, mm) belongs to the space: 0 no, 1 fully. It has
   continuous derivatives: by_y[3] by the point and by_numbers by the numbers; both may be NULL. */
double sdm_fit_open_end_weight(const fit_open_end *e, const double y[3], double *by_y,
                               double *by_numbers);
