/* Rigid poses: where a shape lies in the world. Angles in rad, lengths in mm, frame LPS. */
#ifndef SDM_POSE_H
#define SDM_POSE_H

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* world = R x + translation, x in the shape's frame; R turns about the ORIGIN of the shape's frame.
   `rotation` is a rotation vector: R = exp([rotation]x), a right-handed turn by |rotation| rad
   about the axis `rotation` (Rodrigues 1840). Zero-initialised it is the identity. Rotation vectors
   that differ by whole turns about their axis are the same pose. */
typedef struct sdm_pose {
    double rotation[3];    /* rad */
    double translation[3]; /* mm */
} sdm_pose;

/* Turns by at most 1000 rad, translations of at most 1e100 mm along each axis, all finite;
   SDM_E_ARG names what is not. The functions below take poses that pass. [any thread, as all of
   them] */
SDM_API sdm_status sdm_pose_check(const sdm_pose *pose, sdm_error *err);

/* r[9] = R, row-major, orthonormal to rounding. */
SDM_API void sdm_pose_matrix(const sdm_pose *pose, double r[9]);

/* From the shape's frame to the world, and back; x and world may be the same array. For many points
 * take the matrix once. */
SDM_API void sdm_pose_apply(const sdm_pose *pose, const double x[3], double world[3]);
SDM_API void sdm_pose_apply_inverse(const sdm_pose *pose, const double world[3], double x[3]);

/* The pose that undoes `pose`. */
SDM_API sdm_pose sdm_pose_inverse(const sdm_pose *pose);

/* First `inner`, then `outer`: apply(compose(outer, inner), x) = apply(outer, apply(inner, x)). The
   turn of the result is one of at most pi. */
SDM_API sdm_pose sdm_pose_compose(const sdm_pose *outer, const sdm_pose *inner);

#ifdef __cplusplus
}
#endif
#endif
