/* Start poses from pairs of points, or from a centre and an axis. */
#include <math.h>

#include "sdm/fit.h"
#include "sdm/internal/rotation.h"
#include "sdm/internal/vec3.h"

// rotation vector (rad) of the smallest rotation that turns the direction of a into the direction
// of b
static void smallest_rotation(const double a[3], const double b[3], double rotation[3])
{
    double axis[3];
    v3_cross(a, b, axis);
    const double along = sqrt(v3_dot(axis, axis)), angle = atan2(along, v3_dot(a, b));
    // parallel or opposite: the axis is any perpendicular of a
    if (!(along > 0)) {
        int least = 0;
        for (int k = 1; k < 3; k++)
            if (fabs(a[k]) < fabs(a[least])) least = k;
        double e[3] = {0, 0, 0};
        e[least] = 1;
        v3_cross(a, e, axis);
    }
    const double length = sqrt(v3_dot(axis, axis));
    for (int k = 0; k < 3; k++) rotation[k] = angle * axis[k] / length;
}

// sets the translation such that `from` moves to `to`
static void pose_place(sdm_pose *pose, const double from[3], const double to[3])
{
    double moved[3];
    *pose = (sdm_pose){.rotation = {pose->rotation[0], pose->rotation[1], pose->rotation[2]}};
    sdm_pose_apply(pose, from, moved);
    for (int k = 0; k < 3; k++) pose->translation[k] = to[k] - moved[k];
}

sdm_status sdm_fit_pose_from_axis(const double point[3], const double centre[3],
                                  const double axis[3], sdm_pose *out, sdm_error *err)
{
    if (!point || !centre || !axis || !out)
        return sdm_fail(
            err, SDM_E_ARG,
            "pose from an axis: point, centre, axis and a place for the pose are needed");
    const double length = sqrt(v3_dot(axis, axis));
    if (!(length > 0) || !isfinite(length))
        return sdm_fail(err, SDM_E_ARG, "axis (%g, %g, %g) has no direction", axis[0], axis[1],
                        axis[2]);
    for (int k = 0; k < 3; k++)
        if (!isfinite(point[k]) || !isfinite(centre[k]))
            return sdm_fail(err, SDM_E_ARG,
                            "centre (%g, %g, %g) or point (%g, %g, %g) is not finite", centre[0],
                            centre[1], centre[2], point[0], point[1], point[2]);
    const double unit[3] = {axis[0] / length, axis[1] / length, axis[2] / length};
    smallest_rotation((const double[3]){0, 0, 1}, unit, out->rotation);
    pose_place(out, point, centre);
    return SDM_OK;
}

// unit eigenvector q of the largest eigenvalue of a symmetric 4 x 4 matrix, by Jacobi rotations
static void dominant_eigenvector(double a[4][4], double q[4])
{
    double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int sweep = 0; sweep < 50; sweep++)
        for (int i = 0; i < 3; i++)
            for (int j = i + 1; j < 4; j++) {
                if (a[i][j] == 0) continue;
                const double angle = 0.5 * atan2(2 * a[i][j], a[j][j] - a[i][i]), c = cos(angle),
                             s = sin(angle);
                for (int k = 0; k < 4; k++) {
                    const double x = a[k][i], y = a[k][j];
                    a[k][i] = c * x - s * y, a[k][j] = s * x + c * y;
                }
                for (int k = 0; k < 4; k++) {
                    const double x = a[i][k], y = a[j][k];
                    a[i][k] = c * x - s * y, a[j][k] = s * x + c * y;
                }
                for (int k = 0; k < 4; k++) {
                    const double x = v[k][i], y = v[k][j];
                    v[k][i] = c * x - s * y, v[k][j] = s * x + c * y;
                }
            }
    int most = 0;
    for (int i = 1; i < 4; i++)
        if (a[i][i] > a[most][most]) most = i;
    for (int k = 0; k < 4; k++) q[k] = v[k][most];
}

// rotation that best aligns two point sets (Horn 1987): its quaternion is the dominant eigenvector
// of a matrix made from m = sum over the points of shape * world^T
static void horn_rotation(double m[3][3], double rotation[3])
{
    double a[4][4], q[4];
    a[0][0] = m[0][0] + m[1][1] + m[2][2];
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        a[0][i + 1] = a[i + 1][0] = m[j][k] - m[k][j];
        a[i + 1][i + 1] = m[i][i] - m[j][j] - m[k][k];
        a[i + 1][j + 1] = a[j + 1][i + 1] = m[i][j] + m[j][i];
    }
    dominant_eigenvector(a, q);
    sdm_rotation_of_quaternion(q, rotation);
}

sdm_status sdm_fit_pose_from_points(const double *shape, const double *world, size_t n,
                                    sdm_pose *out, sdm_error *err)
{
    if (!shape || !world || !out)
        return sdm_fail(err, SDM_E_ARG,
                        "pose from points: both lists and a place for the pose are needed");
    if (n < 2)
        return sdm_fail(err, SDM_E_ARG, "a pose from points needs 2 or more of them, not %zu", n);
    // centroids
    double middle[2][3] = {{0}}, m[3][3] = {{0}}, spread[2] = {0, 0}, across = 0, far[2][3] = {{0}};
    for (size_t i = 0; i < 3 * n; i++) {
        if (!isfinite(shape[i]) || !isfinite(world[i]))
            return sdm_fail(err, SDM_E_ARG, "coordinate %zu of point %zu is not finite", i % 3,
                            i / 3);
        middle[0][i % 3] += shape[i] / (double)n;
        middle[1][i % 3] += world[i] / (double)n;
    }
    // sums of products and squares about the centroids; the point farthest from its centroid
    for (size_t i = 0; i < n; i++) {
        double d[2][3];
        for (size_t k = 0; k < 3; k++)
            d[0][k] = shape[3 * i + k] - middle[0][k], d[1][k] = world[3 * i + k] - middle[1][k];
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) m[a][b] += d[0][a] * d[1][b];
        for (int s = 0; s < 2; s++) spread[s] += v3_dot(d[s], d[s]);
        if (v3_dot(d[0], d[0]) > v3_dot(far[0], far[0]))
            for (int k = 0; k < 3; k++) far[0][k] = d[0][k], far[1][k] = d[1][k];
    }
    // across: sum of the squared distances of the points from the line through the centroid and the
    // farthest one
    if (!(spread[0] > 0) || !(spread[1] > 0) || !(v3_dot(far[1], far[1]) > 0))
        return sdm_fail(err, SDM_E_ARG,
                        "the %zu points of a start coincide: no direction can be taken from them",
                        n);
    for (size_t i = 0; i < n; i++) {
        double d[3], c[3];
        for (size_t k = 0; k < 3; k++) d[k] = shape[3 * i + k] - middle[0][k];
        v3_cross(far[0], d, c);
        across += v3_dot(c, c) / v3_dot(far[0], far[0]);
    }
    // rotation, then translation
    if (across > 1e-12 * spread[0])
        horn_rotation(m, out->rotation);
    else // the points lie on one line
        smallest_rotation(far[0], far[1], out->rotation);
    pose_place(out, middle[0], middle[1]);
    return SDM_OK;
}
