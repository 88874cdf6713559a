/* Eigenvectors of the covariance of the places of the voxels inside. */
#include "principal_axes.h"

#include "fit/solver/open_motions.h"

void sdm_fit_principal_axes(const fit_maps *maps, const double centre[3], double axes[9])
{
    double covariance[9] = {0}, spread[3], x[3];
    const size_t nx = (size_t)maps->grid.n[0], ny = (size_t)maps->grid.n[1];
    for (size_t v = 0; v < maps->n_voxels; v++) {
        if (!(maps->distance[v] < 0)) continue;
        const double at[3] = {(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)};
        sdm_grid_world(&maps->grid, at, x);
        for (int i = 0; i < 9; i++)
            covariance[i] += (x[i / 3] - centre[i / 3]) * (x[i % 3] - centre[i % 3]);
    }
    sdm_fit_eigen(3, covariance, spread, axes);
}
