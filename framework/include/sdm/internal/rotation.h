/* Rotation matrices, rotation vectors (see sdm/pose.h) and quaternions. Angles in rad. All
 * functions can be called from any thread. */
#pragma once

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Rotation vector of the unit quaternion q = (w, x, y, z); its length is at most pi. */
void sdm_rotation_of_quaternion(const double q[4], double rotation[3]);

/* Rotation vector of the rotation matrix r[9] (row-major, orthonormal, determinant +1); its length
 * is at most pi. */
void sdm_rotation_vector(const double r[9], double rotation[3]);

/* j[9] = left Jacobian of SO(3), row-major (Chirikjian 2012): R(rotation + d) = R(j d) R(rotation)
 * to first order in d. Hence d(R x + t) / d(rotation) = -[R x]x j. */
void sdm_rotation_jacobian(const double rotation[3], double j[9]);

#ifdef __cplusplus
}
#endif
