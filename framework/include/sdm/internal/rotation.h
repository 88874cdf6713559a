/* Rotation matrices, vectors and quaternions. Angles in rad. [any thread, as all of them] */
#ifndef SDM_INTERNAL_ROTATION_H
#define SDM_INTERNAL_ROTATION_H

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* out[9] = a[9] b[9], row-major; out is neither of them. */
void sdm_rotation_product(const double a[9], const double b[9], double out[9]);

/* The rotation vector, of a length of at most pi, of the unit quaternion q = (w, x, y, z). */
void sdm_rotation_of_quaternion(const double q[4], double rotation[3]);

/* The rotation vector, of a length of at most pi, of the rotation matrix r[9] (row-major,
 * orthonormal, determinant +1). */
void sdm_rotation_vector(const double r[9], double rotation[3]);

/* j[9], row-major: the left Jacobian of SO(3) (Chirikjian 2012), R(rotation + d) = R(j d)
   R(rotation) to first order in d. With it the derivative of world = R x + t by the rotation vector
   is -[R x]x j. */
void sdm_rotation_jacobian(const double rotation[3], double j[9]);

#ifdef __cplusplus
}
#endif
#endif
