/* The losses and their derivatives. */
#include "loss.h"

#include <math.h>

static float sign(float e) { return e > 0 ? 1.0f : e < 0 ? -1.0f : 0.0f; }

static float clamp(float v, float max) { return v > max ? max : v < -max ? -max : v; }

float trainer_loss_slope_drawn(const sdm_config *c, float predicted, float target, double *square)
{
    const float e = predicted - target;
    *square += (double)e * e;
    switch (c->train.loss) {
    case SDM_LOSS_L1:
        return sign(e);
    case SDM_LOSS_HUBER: {
        const float knee = 0.01f; // mm; quadratic below, linear above
        return fabsf(e) < knee ? e / knee : sign(e);
    }
    // Park et al. 2019, equation 4, except that a prediction is clamped only where its target is
    // clamped: an unclamped target always gives a gradient
    case SDM_LOSS_CLAMPED_L1: {
        const float max = (float)c->train.clamp_mm, t = clamp(target, max);
        return fabsf(t) < max || fabsf(predicted) < max || predicted * t < 0 ? sign(predicted - t)
                                                                             : 0.0f;
    }
    case SDM_LOSS_MSE:
        break;
    }
    return 2 * e;
}

float trainer_loss_slope(const sdm_config *c, float predicted, float target, double *square)
{
    const float weight =
        fabsf(target) < (float)c->train.near_mm ? 1 + (float)c->train.near_weight : 1;
    return weight * trainer_loss_slope_drawn(c, predicted, target, square);
}

double trainer_loss_slopes(const sdm_config *c, size_t n, const float *predicted,
                           const float *target, float *slope)
{
    double sum[8] = {0}; // partial sums, so that the additions do not wait for each other
    const bool squares = c->train.loss == SDM_LOSS_MSE && !(c->train.near_weight > 0);
    size_t i = 0;
    for (; squares && i + 8 <= n; i += 8)
        for (size_t j = 0; j < 8; j++) {
            const float e = predicted[i + j] - target[i + j];
            sum[j] += (double)e * e;
            slope[i + j] = 2 * e;
        }
    for (; i < n; i++) slope[i] = trainer_loss_slope(c, predicted[i], target[i], &sum[i % 8]);
    return ((sum[0] + sum[4]) + (sum[1] + sum[5])) + ((sum[2] + sum[6]) + (sum[3] + sum[7]));
}

double trainer_loss_eikonal(const sdm_config *c, const float f[4], float share, float slope[4])
{
    double g[3], square = 0;
    for (int i = 0; i < 3; i++) {
        g[i] = ((double)f[1 + i] - (double)f[0]) / c->grid.spacing[i];
        square += g[i] * g[i];
    }
    const double norm = sqrt(square), excess = norm - 1;
    if (!(norm > 0)) return c->train.eikonal; // no derivative at norm 0: leave it out
    const double factor = 2 * c->train.eikonal * excess / norm * (double)share;
    for (int i = 0; i < 3; i++) {
        const float s = (float)(factor * g[i] / c->grid.spacing[i]);
        slope[1 + i] += s;
        slope[0] -= s;
    }
    return c->train.eikonal * excess * excess;
}

double trainer_loss_map(const sdm_config *c, const float *predicted, const float *target,
                        float *slope)
{
    const size_t nx = (size_t)c->grid.n[0], ny = (size_t)c->grid.n[1], nz = (size_t)c->grid.n[2],
                 n = nx * ny * nz;
    const double square = trainer_loss_slopes(c, n, predicted, target, slope);
    for (size_t v = 0; v < n; v++) slope[v] /= (float)n;
    if (!(c->train.eikonal > 0) || nx < 2 || ny < 2 || nz < 2) return square;
    // eikonal term at the voxels that have a following neighbour along x, y and z
    const float share = 1.0f / (float)((nx - 1) * (ny - 1) * (nz - 1));
    for (size_t z = 0; z + 1 < nz; z++)
        for (size_t y = 0; y + 1 < ny; y++)
            for (size_t x = 0; x + 1 < nx; x++) {
                const size_t v = (z * ny + y) * nx + x, at[4] = {v, v + 1, v + nx, v + nx * ny};
                float f[4], s[4] = {0};
                for (int i = 0; i < 4; i++) f[i] = predicted[at[i]];
                trainer_loss_eikonal(c, f, share, s);
                for (int i = 0; i < 4; i++) slope[at[i]] += s[i];
            }
    return square;
}
