/* Rigid poses: position and orientation of a shape in the world. Angles in rad, lengths in mm,
 * coordinate system LPS (see sdm/grid.h). */
#ifndef SDM_POSE_H
#define SDM_POSE_H

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* world = R x + translation, with x in the coordinate system of the shape; R rotates about the
 * ORIGIN of that system. `rotation` is a rotation vector: R = exp([rotation]x), the right-handed
 * rotation by |rotation| rad about the axis `rotation` (Rodrigues 1840). All zero is the identity.
 * Adding 2 pi to the length of the rotation vector gives the same pose. */
typedef struct sdm_pose {
    double rotation[3];    /* rad */
    double translation[3]; /* mm */
} sdm_pose;

/* Checks that abs(rotation[i]) <= 1000 rad and abs(translation[i]) <= 1e100 mm, hence that all are
 * finite. SDM_E_ARG names the first violation. The functions below need poses that pass this check;
 * all of them can be called from any thread. */
SDM_API sdm_status sdm_pose_check(const sdm_pose *pose, sdm_error *err);

/* r[9] = the rotation matrix R, row-major, orthonormal up to rounding. */
SDM_API void sdm_pose_matrix(const sdm_pose *pose, double r[9]);

/* Position in the world of point x of the shape, and the inverse. x and world may be the same
 * array. For many points compute sdm_pose_matrix() once instead. */
SDM_API void sdm_pose_apply(const sdm_pose *pose, const double x[3], double world[3]);
SDM_API void sdm_pose_apply_inverse(const sdm_pose *pose, const double world[3], double x[3]);

/* The inverse pose. */
SDM_API sdm_pose sdm_pose_inverse(const sdm_pose *pose);

/* The pose that applies `inner` first, then `outer`: apply(compose(outer, inner), x) = apply(outer,
 * apply(inner, x)). The rotation angle of the result is at most pi. */
SDM_API sdm_pose sdm_pose_compose(const sdm_pose *outer, const sdm_pose *inner);

#ifdef __cplusplus
}
#endif
#endif
