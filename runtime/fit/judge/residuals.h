/* Residuals: what the data show at the samples, less what the fitted shape predicts there.

   Voxels: the observed share of the inside material is the value of the voxel on the scale from the
   outside (0) to the inside (1); the prediction is the share that the shape fills. Both ends of the
   scale are least medians of squares over the voxels deep inside and deep outside (where a thin
   shape has none inside, the tissue of the fit). They and the
   noise are robust: the tissues of the fit itself would not do, because a wrong shape widens them
   until they excuse everything. Points: the residual is the signed distance from the surface over
   the largest radius of the shape. */
#pragma once

#include "fit/solver/problem.h"

/* largest distance of voxels, in steps along an axis, over which noise is correlated */
enum { FIT_RESIDUAL_LAGS = 10 };

/* the mean of a tissue may differ from that at the start by this number of the sd at the start */
#define FIT_GIVEN_MAX 3.0

typedef struct fit_residuals {
    /* number of samples */
    size_t n;
    /* [n] predicted share, 0 .. 1 (points: 1); observed less predicted; sd of the noise */
    double *expected, *residual, *sd;
    /* [n] change of the expected share where the maps are wrong by their error: that of the
       network, and of the interpolation between voxels of a surface as curved as the largest ball
       inside */
    double *map_error;
    /* labels: width of the edge of the expected shares, in voxels: the share changes by
       1.6 share (1 - share) / label_width where the surface moves by a voxel; else 0 */
    double label_width;
    /* [n] false: the sample holds a third material, and its residual says nothing */
    bool *used;
    /* [n][3] place of the sample, in steps of the image (points: in halves of the largest radius)
     */
    int32_t *place;
    /* points: place[] is that of the feet (sdm_fit_residuals_use_feet()) */
    bool at_feet;
    /* edge of the cubes in which residuals are averaged, in steps along each axis, >= 1 */
    int32_t edge[3];
    /* correlation of the noise of voxels that lie so many steps apart along each axis */
    double correlation[3][FIT_RESIDUAL_LAGS + 1];
    /* along an axis, pairs become too few before the correlation is small: it is 0 from there on */
    bool unmeasured;
    /* voxels: middle and robust sd of the values deep outside [0] and deep inside [1], and the
       number of these voxels; points: 0 */
    double middle[2], spread[2];
    size_t n_deep[2];
    /* such a voxel's share differs from 0 or 1 by at most this much */
    double deep[2];
} fit_residuals;

/* Computes the residuals at problem->state from its samples. Call sdm_fit_residuals_dispose() even
 * after an error. */
sdm_status sdm_fit_residuals_create(const fit_problem *p, fit_residuals *out, sdm_error *err);

/* Points: place[] becomes the place of the foot of each point (sdm_fit_foot()). Errors as large as
   the edge of a cube would otherwise sort the points inside and outside of the surface into
   different cubes. */
void sdm_fit_residuals_use_feet(const fit_problem *p, fit_residuals *r);

/* Number of correlated voxels that carry as much information as one independent one: the product
   over the axes of the sums of all correlations, 1 or more. 0: nothing is correlated, too few
   voxels lie away from the surface, or the correlation reaches farther than the lags. */
double sdm_fit_residual_correlation(const fit_residuals *r);
void sdm_fit_residuals_dispose(fit_residuals *r);
