/* Rigid poses: rotation vectors, matrices and quaternions. */
#include "sdm/pose.h"

#include <math.h>

// unit quaternion (w, x, y, z)
typedef struct quaternion {
    double w, v[3];
} quaternion;

static double length(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static double sinc(double x) { return x == 0 ? 1 : sin(x) / x; }

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

// m = I + a [r]x + b [r]x^2
static void series(const double r[3], double a, double b, double m[9])
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
            return sdm_fail(err, SDM_E_ARG, "translation along %c is %g mm, need a finite number up to 1e100", axis[i],
                            pose->translation[i]);
        if (!(fabs(pose->rotation[i]) <= 1000))
            return sdm_fail(err, SDM_E_ARG, "rotation vector along %c is %g rad, need a finite number up to 1000",
                            axis[i], pose->rotation[i]);
    }
    return SDM_OK;
}

void sdm_pose_matrix(const sdm_pose *pose, double r[9])
{
    // (1 - cos t) / t^2 = sinc(t / 2)^2 / 2 does not cancel at small angles
    const double angle = length(pose->rotation), half = sinc(0.5 * angle);
    series(pose->rotation, sinc(angle), 0.5 * half * half, r);
}

void sdm_pose_apply(const sdm_pose *pose, const double x[3], double world[3])
{
    const double v[3] = {x[0], x[1], x[2]};
    double r[9];
    sdm_pose_matrix(pose, r);
    for (int i = 0; i < 3; i++)
        world[i] = r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2] + pose->translation[i];
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

static quaternion quaternion_of(const double rotation[3])
{
    const double half = 0.5 * length(rotation), s = 0.5 * sinc(half);
    return (quaternion){cos(half), {s * rotation[0], s * rotation[1], s * rotation[2]}};
}

// the shorter of the two turns that q and -q stand for
static void vector_of(quaternion q, double rotation[3])
{
    const double sine = length(q.v), sign = q.w < 0 ? -1 : 1;
    const double scale = sine == 0 ? 2 * sign : 2 * sign * atan2(sine, fabs(q.w)) / sine;
    for (int i = 0; i < 3; i++) rotation[i] = scale * q.v[i];
}

sdm_pose sdm_pose_compose(const sdm_pose *outer, const sdm_pose *inner)
{
    const quaternion a = quaternion_of(outer->rotation), b = quaternion_of(inner->rotation);
    quaternion q = {.w = a.w * b.w - (a.v[0] * b.v[0] + a.v[1] * b.v[1] + a.v[2] * b.v[2])};
    cross(a.v, b.v, q.v);
    for (int i = 0; i < 3; i++) q.v[i] += a.w * b.v[i] + b.w * a.v[i];
    sdm_pose both;
    vector_of(q, both.rotation);
    sdm_pose_apply(outer, inner->translation, both.translation);
    return both;
}

void sdm_rotation_vector(const double r[9], double rotation[3])
{
    // Shepperd (1978): from the largest of the four squares, so that no small number is divided by
    const double trace = r[0] + r[4] + r[8];
    int k = 0;
    for (int i = 1; i < 3; i++)
        if (r[4 * i] > r[4 * k]) k = i;
    quaternion q;
    if (trace >= r[4 * k]) {
        const double w2 = sqrt(1 + trace);
        q = (quaternion){0.5 * w2, {0.5 * (r[7] - r[5]) / w2, 0.5 * (r[2] - r[6]) / w2, 0.5 * (r[3] - r[1]) / w2}};
    } else {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        const double v2 = sqrt(1 + 2 * r[4 * k] - trace);
        q.w = 0.5 * (r[3 * j + i] - r[3 * i + j]) / v2;
        q.v[k] = 0.5 * v2;
        q.v[i] = 0.5 * (r[3 * i + k] + r[3 * k + i]) / v2;
        q.v[j] = 0.5 * (r[3 * j + k] + r[3 * k + j]) / v2;
    }
    vector_of(q, rotation);
}

// (t - sin t) / t^3: the formula cancels at small angles
static double third_coefficient(double angle)
{
    const double square = angle * angle;
    if (angle >= 1) return (1 - sinc(angle)) / square;
    double sum = 1;
    for (int n = 19; n >= 5; n -= 2) sum = 1 - square / (n * (n - 1)) * sum;
    return sum / 6;
}

void sdm_rotation_jacobian(const double rotation[3], double j[9])
{
    const double angle = length(rotation), half = sinc(0.5 * angle);
    series(rotation, 0.5 * half * half, third_coefficient(angle), j);
}
