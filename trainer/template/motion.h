/* Motion of a set of points: the frame that fits it best. Frames map x to m x + b; matrices are
   row-major. */
#pragma once

#include <stddef.h>
#include <stdint.h>

typedef struct motion {
    double m[9], b[3];
} motion;

/* *out = the rigid motion (rotation and translation) that carries from[3] of the vertices
   vertex[n] to to[3] with the smallest sum of squared distances (Horn 1987). Returns the root mean
   square distance that remains. */
double trainer_motion_rigid(const double *from, const double *to, const uint32_t *vertex, size_t n,
                            motion *out);

/* The same with any affine map. A degenerate set of points (all in a plane) gets the rigid
   motion. */
double trainer_motion_affine(const double *from, const double *to, const uint32_t *vertex, size_t n,
                             motion *out);

/* Distance between the point to which a motion carries x[3], and to[3]. */
double trainer_motion_error(const motion *a, const double x[3], const double to[3]);

/* *out = outer^-1 inner; outer must be invertible. */
void trainer_motion_relative(const motion *outer, const motion *inner, motion *out);

/* out[3] = m^-1 (x - b) */
void trainer_motion_back(const motion *a, const double x[3], double out[3]);

/* Polar decomposition m = rotation (I + stretch): rotation[3] as a rotation vector, stretch[6] =
   xx, yy, zz, yz, xz, xy. */
void trainer_motion_polar(const double m[9], double rotation[3], double stretch[6]);
