/* Voxels of the inner band with their residuals and scores, and look-up of the neighbour at a lag.
 * The inner band holds the samples near the surface whose scores are not negligible, see
 * sdm_fit_in_inner_band(). Autocorrelation and score covariance are sums over its voxels. */
#pragma once

#include "fit/solver/problem.h"

enum {
    /* largest lag along an axis, in steps (problem->stride voxels) */
    FIT_LAG_MAX = 10,
    /* number of lags along an axis */
    FIT_LAGS = 2 * FIT_LAG_MAX + 1,
    /* index of lag zero; the lags of smaller index are one half of all others, those of larger
     * index are their opposites */
    FIT_LAG_ZERO = FIT_LAGS * FIT_LAGS * FIT_LAGS / 2
};

/* The n voxels of the inner band. */
typedef struct fit_neighbours {
    size_t n, n_unknowns;
    /* bounding box of the voxels: extent in steps, index of its first voxel in the image, image
     * voxels per step */
    int64_t size[3], first[3], step;
    /* [size[2]][size[1]][size[0]] 1 + number of the voxel there; 0: none */
    uint32_t *number_at;
    /* [n][3] index of each voxel in the box, in steps */
    int32_t *position;
    /* [n] random number of each voxel, see sdm_fit_sample_draw(); a subsample is the voxels whose
     * number is at most a threshold */
    float *draw;
    /* [n] normalised residual; weight of the voxel in correlations */
    float *residual, *weight;
    /* [n][n_unknowns] score = residual * root */
    float *root;
    /* [n][n_unknowns] expected score caused by a map error of 1 mm */
    float *model_score;
} fit_neighbours;

/* Collects the voxels from the samples of *problem, evaluated at problem->state. Call
 * sdm_fit_neighbours_dispose() even after an error. */
sdm_status sdm_fit_neighbours_create(const fit_problem *p, fit_neighbours *out, sdm_error *err);
void sdm_fit_neighbours_dispose(fit_neighbours *v);

/* Whether a sample belongs to the inner band: its derivative by the surface is large enough to
   matter in correlations, a stricter test than sdm_fit_in_band(). sdm_fit_inner_band_count()
   returns the number of such samples. */
bool sdm_fit_in_inner_band(const fit_problem *p, size_t sample);
size_t sdm_fit_inner_band_count(const fit_problem *p);

/* A random number 0 .. 1, a function of the position in the world alone: another order of the axes
 * in memory, or another field of view, selects the same voxels. Images and label maps only. */
double sdm_fit_sample_draw(const fit_problem *p, size_t sample);

/* Threshold of `draw` that selects about `wanted` voxels; above 1 where there are fewer. */
float sdm_fit_neighbours_threshold(const fit_neighbours *v, double wanted);

/* *list: increasing numbers of about `wanted` voxels, *n of them; the caller frees it with
 * sdm_free(). */
sdm_status sdm_fit_neighbours_pick(const fit_neighbours *v, double wanted, uint32_t **list,
                                   size_t *n, sdm_error *err);

/* The lag of a number, 0 .. FIT_LAGS^3 - 1, in steps along each axis. */
static inline void sdm_fit_lag_vector(int number, int lag[3])
{
    lag[0] = number % FIT_LAGS - FIT_LAG_MAX;
    lag[1] = number / FIT_LAGS % FIT_LAGS - FIT_LAG_MAX;
    lag[2] = number / (FIT_LAGS * FIT_LAGS) - FIT_LAG_MAX;
}

/* Maximum norm of a lag. */
static inline int sdm_fit_lag_length(const int lag[3])
{
    int most = 0;
    for (int a = 0; a < 3; a++)
        if (lag[a] > most || -lag[a] > most) most = lag[a] > 0 ? lag[a] : -lag[a];
    return most;
}

/* Number of the voxel at sign * lag from voxel i, or SIZE_MAX. */
static inline size_t sdm_fit_neighbour(const fit_neighbours *v, size_t i, const int lag[3],
                                       int sign)
{
    int64_t k[3];
    for (int a = 0; a < 3; a++) {
        k[a] = v->position[3 * i + (size_t)a] + sign * lag[a];
        if (k[a] < 0 || k[a] >= v->size[a]) return SIZE_MAX;
    }
    const uint32_t found = v->number_at[(k[2] * v->size[1] + k[1]) * v->size[0] + k[0]];
    return found ? found - 1 : SIZE_MAX;
}
