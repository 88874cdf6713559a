/* Rigid motions that the data do not determine, such as the rotation of a shape about an axis of
 * symmetry. The steps leave them alone, and the covariance gives them the uncertainty of a pose
 * that is not known at all. */
#pragma once

#include "problem.h"

/* A motion is open if the surface moves by less than this along its normal, in voxels of the map:
 * about the error of the interpolated map. */
#define FIT_MOTION_MIN 0.05

/* *to = *from moved along the screw motion m[6] (rotation vector, translation at the origin of the
 * shape), for the time `angle`. */
void sdm_fit_move_along(const fit_state *from, const double m[6], double angle, fit_state *to);

/* Fills problem->motion[problem->n_motions] for the evaluated state: motions that leave the field
   at the samples as it is (Gelfand and Guibas 2004: slippable motions), to a small part of a voxel
   of the map, over angles up to 0.7 rad; and those that the information determines less than the
   weakest prior. None where the pose is kept. */
void sdm_fit_open_motions_find(fit_problem *p);

/* Adds to the information matrix a[N][N] a precision that stops the steps along the open motions
   for which the options have no prior. */
void sdm_fit_open_motions_stop(const fit_problem *p, double *a);

/* Adds to the covariance c[n_params + 6][n_params + 6] the variance that the weakest prior has
   along those open motions. */
void sdm_fit_open_motions_spread(const fit_problem *p, double *c);

/* Names the open motions, e.g. "rotation about the axis (0, 0, 1) through (1, 2, 3) mm". An empty
   text: there are none. */
void sdm_fit_open_motions_describe(const fit_problem *p, char *text, size_t size);

/* rms motion (mm) of the surface at the samples, along its normal, from the evaluated state to the
 * pose of another. */
double sdm_fit_surface_motion(const fit_problem *p, const fit_state *to);

/* Square of the change of the field at a sample of the band per mm of motion of the surface along
 * its normal. */
double sdm_fit_slope_squared(const fit_problem *p, size_t sample);

/* Eigenvalues, in increasing order, and orthonormal eigenvectors (rows of vector[n][n]) of the
   symmetric matrix a[n][n], n <= 6, which is changed (Jacobi 1846). */
void sdm_fit_eigen(size_t n, double *a, double *value, double *vector);
