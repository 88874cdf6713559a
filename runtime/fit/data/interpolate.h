/* Interpolation of fields between the voxels of their grid. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"

/* n_fields fields on one grid, packed[voxels][n_fields]; the grid's voxels in the order z, y, x. */
typedef struct fit_field {
    const sdm_grid *grid;
    const double *packed;
    size_t n_fields;
    /* true: packed holds values, interpolated by cubic convolution (Keys 1981), which reproduces
       them at the voxels. Beyond the grid the distance to its border is added to the first field.

       false: packed holds coefficients of cubic B-splines, whose second derivatives are continuous;
       Newton's method converges well only on a likelihood that is as smooth. Beyond the grid the
       values of the border continue. */
    bool distance;
} fit_field;

/* Returns the first field at x (frame of the grid, mm). The interpolated field is continuous, and
 * so is its gradient. [any thread] */
double sdm_fit_interpolate(const fit_field *f, const double x[3]);

/* As sdm_fit_interpolate(), bit for bit, but also computes gradient[3] of the first field (frame of
 * the grid, per mm) and the values of the other fields, rest[n_fields - 1]. [any thread] */
double sdm_fit_interpolate_all(const fit_field *f, const double x[3], double gradient[3],
                               double *rest);

/* The values of all fields at x, out[n_fields], the first within rounding of sdm_fit_interpolate().
 * [any thread] */
void sdm_fit_interpolate_fields(const fit_field *f, const double x[3], double *out);
