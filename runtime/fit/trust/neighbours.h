/* Voxels near the surface, found by their place: what the correlation of residuals and the
 * covariance of the score are summed over. */
#ifndef FIT_SHELL_H
#define FIT_SHELL_H

#include "fit/solver/newton.h"

/* Largest lag along an axis, in steps of the voxels that are used. */
enum {
    FIT_LAG_MOST = 10,
    FIT_LAGS = 2 * FIT_LAG_MOST + 1,
    FIT_LAG_MIDDLE = FIT_LAGS * FIT_LAGS * FIT_LAGS / 2
};

typedef struct fit_shell {
    size_t n, n_unknowns;
    int64_t size[3], from[3], step; // the box, in steps
    uint32_t *at;                   // [size] 1 + number of the voxel, or 0
    int32_t *place;                 // [n][3] in the box
    float *lot;               // [n] 0 .. 1 at random, of the voxel alone: the lowest are picked
    float *residual, *weight; // [n]
    float *root;              // [n][n_unknowns]
    float *push;              // [n][n_unknowns] score by an error of the map of 1 mm
} fit_shell;

/* From the sites of problem->state. sdm_fit_shell_dispose() frees it in every case. */
sdm_status sdm_fit_shell_create(const fit_problem *p, fit_shell *out, sdm_error *err);
void sdm_fit_shell_dispose(fit_shell *v);

/* Whether the score of a site says anything of the shape, and how many do. */
bool sdm_fit_in_shell(const fit_problem *p, size_t site);
size_t sdm_fit_count_shell(const fit_problem *p);

/* Lots up to this are about `wanted` voxels of the shell. */
float sdm_fit_shell_share(const fit_shell *v, double wanted);

/* The numbers of about so many voxels, in order; the caller frees *list with sdm_free(). */
sdm_status sdm_fit_shell_pick(const fit_shell *v, double wanted, uint32_t **list, size_t *n,
                              sdm_error *err);

/* Lags are numbered through; those above FIT_LAG_MIDDLE, which is no lag, are the other half of a
 * symmetric table. */
static inline void sdm_fit_lag_of(int number, int lag[3])
{
    lag[0] = number % FIT_LAGS - FIT_LAG_MOST;
    lag[1] = number / FIT_LAGS % FIT_LAGS - FIT_LAG_MOST;
    lag[2] = number / (FIT_LAGS * FIT_LAGS) - FIT_LAG_MOST;
}

/* Along the axis where it is the longest. */
static inline int sdm_fit_lag_size(const int lag[3])
{
    int most = 0;
    for (int a = 0; a < 3; a++)
        if (lag[a] > most || -lag[a] > most) most = lag[a] > 0 ? lag[a] : -lag[a];
    return most;
}

/* Number of the voxel at sign * lag from voxel i, or SIZE_MAX. */
static inline size_t sdm_fit_neighbour(const fit_shell *v, size_t i, const int lag[3], int sign)
{
    int64_t k[3];
    for (int a = 0; a < 3; a++) {
        k[a] = v->place[3 * i + (size_t)a] + sign * lag[a];
        if (k[a] < 0 || k[a] >= v->size[a]) return SIZE_MAX;
    }
    const uint32_t found = v->at[(k[2] * v->size[1] + k[1]) * v->size[0] + k[0]];
    return found ? found - 1 : SIZE_MAX;
}

#endif
