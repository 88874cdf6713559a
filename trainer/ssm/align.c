/* Generalised Procrustes analysis of corresponding shapes. */
#include <math.h>
#include <string.h>

#include "numerics/linalg.h"
#include "sdm/internal/ssm_build.h"
#include "sdm/memory.h"

enum { ROUNDS_MAX = 100 };

/* Moves the centroid to 0 and returns the centroid size, the root of the sum of squares. */
static double centre(size_t n_vert, double *v, double centroid[3])
{
    double sum = 0;
    for (size_t d = 0; d < 3; d++) {
        double c = 0;
        for (size_t i = 0; i < n_vert; i++) c += v[3 * i + d];
        centroid[d] = c / (double)n_vert;
        for (size_t i = 0; i < n_vert; i++) {
            v[3 * i + d] -= centroid[d];
            sum += v[3 * i + d] * v[3 * i + d];
        }
    }
    return sqrt(sum);
}

/* The rotation that moves the centred v onto the centred target: the quaternion is the leading
 * eigenvector of a matrix of their products. */
static sdm_status rotate_onto(size_t n_vert, const double *target, double *v, sdm_error *err)
{
    double m[3][3] = {{0}}, values[4];
    for (size_t i = 0; i < n_vert; i++)
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) m[a][b] += v[3 * i + (size_t)a] * target[3 * i + (size_t)b];
    double q[16] = {
        m[0][0] + m[1][1] + m[2][2], m[1][2] - m[2][1],           m[2][0] - m[0][2],
        m[0][1] - m[1][0],           m[1][2] - m[2][1],           m[0][0] - m[1][1] - m[2][2],
        m[0][1] + m[1][0],           m[2][0] + m[0][2],           m[2][0] - m[0][2],
        m[0][1] + m[1][0],           m[1][1] - m[0][0] - m[2][2], m[1][2] + m[2][1],
        m[0][1] - m[1][0],           m[2][0] + m[0][2],           m[1][2] + m[2][1],
        m[2][2] - m[0][0] - m[1][1]};
    const sdm_status s = trainer_eigen_symmetric(4, q, values, err);
    if (s) return s;
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double r[3][3] = {
        {w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
        {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
        {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
    for (size_t i = 0; i < n_vert; i++) {
        const double p[3] = {v[3 * i], v[3 * i + 1], v[3 * i + 2]};
        for (size_t d = 0; d < 3; d++)
            v[3 * i + d] = r[d][0] * p[0] + r[d][1] * p[1] + r[d][2] * p[2];
    }
    return SDM_OK;
}

static void take_mean(size_t n, size_t n_vert, const double *vert, double *mean)
{
    for (size_t k = 0; k < 3 * n_vert; k++) {
        double sum = 0;
        for (size_t i = 0; i < n; i++) sum += vert[3 * n_vert * i + k];
        mean[k] = sum / (double)n;
    }
}

/* Centres all shapes; *keep is the centroid of the first. Scales them, if asked. */
static sdm_status centre_all(size_t n, size_t n_vert, bool scale, double *vert, double keep[3],
                             double *sizes, sdm_error *err)
{
    double mean_size = 0, centroid[3];
    for (size_t i = 0; i < n; i++) {
        sizes[i] = centre(n_vert, vert + 3 * n_vert * i, i ? centroid : keep);
        if (!(sizes[i] > 0 && isfinite(sizes[i])))
            return sdm_fail(err, SDM_E_ARG, "all points of shape %zu are equal", i + 1);
        mean_size += sizes[i] / (double)n;
    }
    for (size_t i = 0; i < n && scale; i++)
        for (size_t k = 0; k < 3 * n_vert; k++) vert[3 * n_vert * i + k] *= mean_size / sizes[i];
    return SDM_OK;
}

sdm_status sdm_ssm_align(size_t n, size_t n_vert, bool scale, double *vert, double *mean,
                         sdm_error *err)
{
    if (n < 2) return sdm_fail(err, SDM_E_ARG, "%zu shapes, a model needs at least 2", n);
    double keep[3], change = INFINITY, *sizes = NULL, *before = NULL;
    sdm_status s = SDM_ALLOC(&sizes, n, "sizes of shapes", err);
    if (!s) s = SDM_ALLOC(&before, 3 * n_vert, "mean shape", err);
    if (!s) s = centre_all(n, n_vert, scale, vert, keep, sizes, err);
    // the first shape is the first mean; afterwards the mean is turned back onto it in every round,
    // which would turn freely otherwise
    if (!s) memcpy(mean, vert, 3 * n_vert * sizeof *mean);
    for (int round = 0; round < ROUNDS_MAX && change > 1e-24 && !s; round++) {
        memcpy(before, mean, 3 * n_vert * sizeof *mean);
        for (size_t i = 0; i < n && !s; i++)
            s = rotate_onto(n_vert, before, vert + 3 * n_vert * i, err);
        take_mean(n, n_vert, vert, mean);
        if (!s) s = rotate_onto(n_vert, before, mean, err);
        double moved = 0, size = 0;
        for (size_t k = 0; k < 3 * n_vert; k++) {
            moved += (mean[k] - before[k]) * (mean[k] - before[k]);
            size += before[k] * before[k];
        }
        change = moved / size;
    }
    for (size_t i = 0; i < n && !s; i++) s = rotate_onto(n_vert, mean, vert + 3 * n_vert * i, err);
    if (!s)
        for (size_t k = 0; k < 3 * n_vert * n; k++) vert[k] += keep[k % 3];
    if (!s) take_mean(n, n_vert, vert, mean);
    sdm_free(before);
    sdm_free(sizes);
    return s;
}
