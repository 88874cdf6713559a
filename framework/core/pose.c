/* Rigid poses; rotation vectors, matrices and quaternions. */
#include "sdm/pose.h"
#include "sdm/internal/rotation.h"

#include <math.h>

static double vector_length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double sinc(double x) { return x == 0 ? 1 : sin(x) / x; }

static void vector_cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* m = I + a [r]x + b [r]x^2, where [r]x is the matrix of the cross product with r. */
static void rotation_series(const double r[3], double a, double b, double m[9])
{
    const double square = r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
    const double skew[9] = {0, -r[2], r[1], r[2], 0, -r[0], -r[1], r[0], 0};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const double squared = r[i] * r[k] - (i == k ? square : 0);
            m[3 * i + k] = (i == k) + a * skew[3 * i + k] + b * squared;
        }
}

sdm_status sdm_pose_check(const sdm_pose *pose, sdm_error *err)
{
    static const char axis[] = "xyz";
    if (!pose) return sdm_fail(err, SDM_E_ARG, "a pose is needed");
    for (int i = 0; i < 3; i++) {
        if (!(fabs(pose->translation[i]) <= 1e100))
            return sdm_fail(err, SDM_E_ARG,
                            "translation along %c is %g mm, need a finite number up to 1e100",
                            axis[i], pose->translation[i]);
        if (!(fabs(pose->rotation[i]) <= 1000))
            return sdm_fail(err, SDM_E_ARG,
                            "rotation vector along %c is %g rad, need a finite number up to 1000",
                            axis[i], pose->rotation[i]);
    }
    return SDM_OK;
}

void sdm_pose_matrix(const sdm_pose *pose, double r[9])
{
    // (1 - cos t) / t^2 = sinc(t / 2)^2 / 2 has no cancellation at small angles
    const double angle = vector_length(pose->rotation), half = sinc(0.5 * angle);
    rotation_series(pose->rotation, sinc(angle), 0.5 * half * half, r);
}

void sdm_pose_apply(const sdm_pose *pose, const double x[3], double world[3])
{
    const double v[3] = {x[0], x[1], x[2]};
    double r[9];
    sdm_pose_matrix(pose, r);
    for (int i = 0; i < 3; i++)
        world[i] =
            r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2] + pose->translation[i];
}

void sdm_pose_apply_inverse(const sdm_pose *pose, const double world[3], double x[3])
{
    const double *t = pose->translation, d[3] = {world[0] - t[0], world[1] - t[1], world[2] - t[2]};
    double r[9];
    sdm_pose_matrix(pose, r);
    for (int i = 0; i < 3; i++) x[i] = r[i] * d[0] + r[3 + i] * d[1] + r[6 + i] * d[2];
}

sdm_pose sdm_pose_inverse(const sdm_pose *pose)
{
    static const double origin[3];
    sdm_pose inverse;
    for (int i = 0; i < 3; i++) inverse.rotation[i] = -pose->rotation[i];
    sdm_pose_apply_inverse(pose, origin, inverse.translation);
    return inverse;
}

static void quaternion_of_rotation(const double rotation[3], double q[4])
{
    const double half = 0.5 * vector_length(rotation), s = 0.5 * sinc(half);
    q[0] = cos(half);
    for (int i = 0; i < 3; i++) q[1 + i] = s * rotation[i];
}

void sdm_rotation_of_quaternion(const double q[4], double rotation[3])
{
    // q and -q are the same rotation: take the one with q[0] >= 0, whose angle is at most pi
    const double sine = vector_length(q + 1), sign = q[0] < 0 ? -1 : 1;
    const double scale = sine == 0 ? 2 * sign : 2 * sign * atan2(sine, fabs(q[0])) / sine;
    for (int i = 0; i < 3; i++) rotation[i] = scale * q[1 + i];
}

sdm_pose sdm_pose_compose(const sdm_pose *outer, const sdm_pose *inner)
{
    double a[4], b[4], q[4];
    quaternion_of_rotation(outer->rotation, a);
    quaternion_of_rotation(inner->rotation, b);
    q[0] = a[0] * b[0] - (a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
    vector_cross(a + 1, b + 1, q + 1);
    for (int i = 1; i < 4; i++) q[i] += a[0] * b[i] + b[0] * a[i];
    sdm_pose both;
    sdm_rotation_of_quaternion(q, both.rotation);
    sdm_pose_apply(outer, inner->translation, both.translation);
    return both;
}

void sdm_rotation_vector(const double r[9], double rotation[3])
{
    // Shepperd (1978): compute the largest component of the quaternion first, because the others
    // are divided by it
    const double trace = r[0] + r[4] + r[8];
    int k = 0;
    for (int i = 1; i < 3; i++)
        if (r[4 * i] > r[4 * k]) k = i;
    double q[4];
    if (trace >= r[4 * k]) {
        const double w2 = sqrt(1 + trace);
        q[0] = 0.5 * w2;
        q[1] = 0.5 * (r[7] - r[5]) / w2;
        q[2] = 0.5 * (r[2] - r[6]) / w2;
        q[3] = 0.5 * (r[3] - r[1]) / w2;
    } else {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double v2 = sqrt(1 + 2 * r[4 * k] - trace);
        q[0] = 0.5 * (r[3 * j + i] - r[3 * i + j]) / v2;
        q[1 + k] = 0.5 * v2;
        q[1 + i] = 0.5 * (r[3 * i + k] + r[3 * k + i]) / v2;
        q[1 + j] = 0.5 * (r[3 * j + k] + r[3 * k + j]) / v2;
    }
    sdm_rotation_of_quaternion(q, rotation);
}

/* Returns (t - sin t) / t^3 for the angle t; below 1 rad by its power series, because the formula
 * suffers from cancellation there. */
static double jacobian_coefficient(double angle)
{
    const double square = angle * angle;
    if (angle >= 1) return (1 - sinc(angle)) / square;
    double sum = 1;
    for (int n = 19; n >= 5; n -= 2) sum = 1 - square / (n * (n - 1)) * sum;
    return sum / 6;
}

void sdm_rotation_jacobian(const double rotation[3], double j[9])
{
    const double angle = vector_length(rotation), half = sinc(0.5 * angle);
    rotation_series(rotation, 0.5 * half * half, jacobian_coefficient(angle), j);
}
