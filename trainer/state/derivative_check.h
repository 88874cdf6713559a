/* How well a model holds derivatives by the parameters: errors of distances alone do not tell.
 * Measured on a few held-out shapes that lie within the grid. */
#pragma once

#include "sdm/internal/verdict.h"
#include "trainer.h"

typedef struct derivative_check {
    size_t shapes; /* that were compared; 0: not measured */
    /* Relative errors, the root mean square of the error over that of the right value, of the
       parameter with the largest one, and the index of this parameter: of the derivatives of the
       map within half a voxel of the surface (farther inside thin walls a distance has a ridge,
       where its derivative jumps), compared with differences of exact distances; of the derivative
       of the volume, compared with that of the meshes. Where a parameter changes the volume by less
       than 5 % over its range, these 5 % count as its root mean square. NaN: not measured. Of the
       map, a parameter that moves no part of the surface has no figure. */
    double slope, volume_slope;
    size_t slope_param, volume_slope_param;
    /* the same of every parameter */
    double slopes[SDM_POD_MAX_PARAMS], volume_slopes[SDM_POD_MAX_PARAMS];
    /* Of the derivative of the volume, over its own root mean square alone, however small. Where
       the parameter does not change the volume: infinite if the figure above exceeds
       SDM_DERIVATIVE_BAD, else NaN. */
    double volume_own[SDM_POD_MAX_PARAMS];
    /* The error of volume_own that exact maps on the same voxels have, of each parameter that
       changes the volume by at least 5 % and whose volume_own exceeds SDM_DERIVATIVE_BAD; else
       NaN. */
    double voxels_slopes[SDM_POD_MAX_PARAMS];
    bool still[SDM_POD_MAX_PARAMS];        /* it moves no part of the surface over its range */
    bool volume_small[SDM_POD_MAX_PARAMS]; /* it changes it by less than 5 % over its range */
} derivative_check;

/* Measures m on 32 shapes; of more than twelve parameters, or when a twentieth of a budget of time
   is used for it, on fewer, but on four at least. A model whose derivatives take more than 1 GB, or
   whose network is slow (t->kind->slow), is not measured. [t->n_threads threads; without a budget
   of time the same bits for any number] */
sdm_status trainer_derivative_check(const trainer *t, const sdm_model *m, derivative_check *out,
                                    sdm_error *err);

/* Sets *out to figures that are not known. */
void trainer_derivatives_unknown(derivative_check *out);

/* text = the parameters p[n] whose relative errors exceed SDM_DERIVATIVE_BAD, the worst first, as
   sdm_verdict.derivatives_bad. An error that is NaN is not known. */
void trainer_list_derivatives(const sdm_param *p, const double *error, size_t n,
                              char text[SDM_VERDICT_LIST]);

/* text = the errors voxels[n] of exact maps for the parameters of the list above, with what mends
   them, as sdm_verdict.volume_causes. */
void trainer_list_causes(const sdm_param *p, const double *error, const double *voxels, size_t n,
                         char text[SDM_VERDICT_LIST]);

/* text = the names of the parameters p[n] that are still[n], as sdm_verdict.still_params. */
void trainer_list_still(const sdm_param *p, const bool *still, size_t n,
                        char text[SDM_VERDICT_LIST]);

/* The same as sdm_verdict.volume_derivatives_small, of parameters that hardly change the volume. */
void trainer_list_small(const sdm_param *p, const double *error, size_t n,
                        char text[SDM_VERDICT_LIST]);
