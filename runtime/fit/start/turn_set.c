/* Rotations that cover an axis or the sphere evenly. */
#include "turn_set.h"

#include <math.h>

#include "sdm/internal/rotation.h"

#define PI 3.14159265358979324

void sdm_fit_turn(sdm_fit_turns turns, size_t i, size_t n, double rotation[9])
{
    sdm_pose pose = {{0, 0, 0}, {0, 0, 0}};
    if (turns == SDM_FIT_TURNS_AXIS) pose.rotation[2] = 2 * PI * (double)i / (double)n;
    if (turns == SDM_FIT_TURNS_SPHERE && i > 0) { // turn 0 is the identity
        const double phi = 1.4142135623730951, psi = 1.533751168755204288118041,
                     s = (double)i + 0.5;
        const double t = s / (double)n, d = 2 * PI * s, r = sqrt(t), big = sqrt(1 - t);
        const double q[4] = {big * cos(d / psi), r * sin(d / phi), r * cos(d / phi),
                             big * sin(d / psi)};
        sdm_rotation_of_quaternion(q, pose.rotation);
    }
    sdm_pose_matrix(&pose, rotation);
}

double sdm_fit_angle_between(const double a[9], const double b[9])
{
    double trace = 0;
    for (int i = 0; i < 9; i++) trace += a[i] * b[i];
    return acos(fmax(fmin(0.5 * (trace - 1), 1), -1));
}
