/* Least squares frames between two sets of points. */
#include "motion.h"

#include <math.h>
#include <string.h>

#include "numerics/linalg.h"
#include "sdm/internal/mat3.h"
#include "sdm/internal/rotation.h"
#include "sdm/pose.h"

// means[2][3] of both sets; cross[9] = sum of (to - mean) (from - mean)^T, spread[9] = sum of
// (from - mean) (from - mean)^T
static void moments(const double *from, const double *to, const uint32_t *vertex, size_t n,
                    double means[2][3], double cross[9], double spread[9])
{
    memset(means, 0, 6 * sizeof(double));
    memset(cross, 0, 9 * sizeof *cross);
    memset(spread, 0, 9 * sizeof *spread);
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) {
            means[0][a] += from[3 * vertex[i] + (size_t)a] / (double)n;
            means[1][a] += to[3 * vertex[i] + (size_t)a] / (double)n;
        }
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) {
                const double q = from[3 * vertex[i] + (size_t)b] - means[0][b];
                cross[3 * a + b] += (to[3 * vertex[i] + (size_t)a] - means[1][a]) * q;
                spread[3 * a + b] += (from[3 * vertex[i] + (size_t)a] - means[0][a]) * q;
            }
}

double trainer_motion_error(const motion *a, const double x[3], const double to[3])
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const double e =
            a->m[3 * i] * x[0] + a->m[3 * i + 1] * x[1] + a->m[3 * i + 2] * x[2] + a->b[i] - to[i];
        sum += e * e;
    }
    return sqrt(sum);
}

// b from m and the means; returns the root mean square distance
static double finish(const double *from, const double *to, const uint32_t *vertex, size_t n,
                     const double means[2][3], motion *out)
{
    for (int a = 0; a < 3; a++)
        out->b[a] = means[1][a] - (out->m[3 * a] * means[0][0] + out->m[3 * a + 1] * means[0][1] +
                                   out->m[3 * a + 2] * means[0][2]);
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        for (int a = 0; a < 3; a++) {
            const double *x = from + 3 * vertex[i];
            const double e = out->m[3 * a] * x[0] + out->m[3 * a + 1] * x[1] +
                             out->m[3 * a + 2] * x[2] + out->b[a] - to[3 * vertex[i] + (size_t)a];
            sum += e * e;
        }
    return sqrt(sum / (double)n);
}

double trainer_motion_rigid(const double *from, const double *to, const uint32_t *vertex, size_t n,
                            motion *out)
{
    double means[2][3], c[9], spread[9];
    moments(from, to, vertex, n, means, c, spread);
    // the quaternion is the leading eigenvector of Horn's matrix; c[3 a + b] = sum to_a from_b
    const double xx = c[0], xy = c[3], xz = c[6], yx = c[1], yy = c[4], yz = c[7], zx = c[2],
                 zy = c[5], zz = c[8];
    double q[16] = {xx + yy + zz, yz - zy, zx - xz, xy - yx,     yz - zy,      xx - yy - zz,
                    xy + yx,      zx + xz, zx - xz, xy + yx,     yy - xx - zz, yz + zy,
                    xy - yx,      zx + xz, yz + zy, zz - xx - yy};
    double values[4];
    sdm_pose pose = {.rotation = {0, 0, 0}};
    if (!trainer_eigen_symmetric(4, q, values, NULL)) sdm_rotation_of_quaternion(q, pose.rotation);
    sdm_pose_matrix(&pose, out->m);
    return finish(from, to, vertex, n, (const double(*)[3])means, out);
}

double trainer_motion_affine(const double *from, const double *to, const uint32_t *vertex, size_t n,
                             motion *out)
{
    double means[2][3], c[9], spread[9], inverse[9];
    moments(from, to, vertex, n, means, c, spread);
    const double trace = spread[0] + spread[4] + spread[8];
    if (!(m3_inverse(spread, inverse) > 1e-9 * trace * trace * trace))
        return trainer_motion_rigid(from, to, vertex, n, out);
    m3_product(c, inverse, out->m);
    return finish(from, to, vertex, n, (const double(*)[3])means, out);
}

void trainer_motion_relative(const motion *outer, const motion *inner, motion *out)
{
    double inverse[9];
    m3_inverse(outer->m, inverse);
    m3_product(inverse, inner->m, out->m);
    trainer_motion_back(outer, inner->b, out->b);
}

void trainer_motion_back(const motion *a, const double x[3], double out[3])
{
    double inverse[9], d[3];
    m3_inverse(a->m, inverse);
    for (int i = 0; i < 3; i++) d[i] = x[i] - a->b[i];
    m3_apply(inverse, d, out);
}

void trainer_motion_polar(const double m[9], double rotation[3], double stretch[6])
{
    // m^T m = V diag(s^2) V^T; the stretch is V diag(s) V^T, the rotation m V diag(1 / s) V^T
    double g[9], values[3], u[9] = {0}, back[9] = {0}, r[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            g[3 * i + j] = m[i] * m[j] + m[3 + i] * m[3 + j] + m[6 + i] * m[6 + j];
    memset(rotation, 0, 3 * sizeof *rotation);
    memset(stretch, 0, 6 * sizeof *stretch);
    if (trainer_eigen_symmetric(3, g, values, NULL)) return;
    for (int k = 0; k < 3; k++) {
        const double s = sqrt(fmax(values[k], 1e-12));
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                u[3 * i + j] += s * g[3 * k + i] * g[3 * k + j];
                back[3 * i + j] += g[3 * k + i] * g[3 * k + j] / s;
            }
    }
    m3_product(m, back, r);
    sdm_rotation_vector(r, rotation);
    const double six[6] = {u[0] - 1, u[4] - 1, u[8] - 1, u[5], u[2], u[1]};
    memcpy(stretch, six, sizeof six);
}
