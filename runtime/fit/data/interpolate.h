/* Packed fields between the voxels of their grid. */
#ifndef FIT_SAMPLE_H
#define FIT_SAMPLE_H

#include <stdbool.h>

#include "sdm/grid.h"

/* packed[voxels][n_fields] on a grid. distance: values, between the voxels by cubic convolution
   (Keys 1981), which goes through them; beyond the grid the distance to its border is added to the
   first field. Else coefficients of cubic B-splines, which have continuous second derivatives
   (steps towards a maximum want a likelihood that is as smooth); beyond the grid the values are
   those of the border. */
typedef struct fit_field {
    const sdm_grid *grid;
    const double *packed;
    size_t n_fields;
    bool distance;
} fit_field;

/* First field at x (frame of the grid): continuous with its gradient. */
double sdm_fit_sample(const fit_field *f, const double x[3]);

/* The same with its gradient (frame of the grid, per mm), and the other fields: rest[n_fields - 1].
 */
double sdm_fit_sample_all(const fit_field *f, const double x[3], double gradient[3], double *rest);

#endif
