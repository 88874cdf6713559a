/* How well a model holds volumes, and derivatives by the parameters: errors of distances alone do
   not tell. Measured on a few held-out shapes that lie within the grid. */
#pragma once

#include "trainer.h"

typedef struct derivative_check {
    /* Error of the volume of the model's map (sdm_map_volume()) over the volume of the mesh: root
       mean square, and the largest; NaN: no shape lies within the grid. */
    double volume, volume_max;
    /* Relative errors, the root mean square of the error over that of the right value, of the
       parameter with the largest one, and the index of this parameter: of the derivatives of the
       map within half a voxel of the surface (farther inside thin walls a distance has a ridge,
       where its derivative jumps), compared with differences of exact maps; of the derivative of
       the volume, compared with that of the meshes. Where a parameter changes the volume by less
       than 5 % over its range, these 5 % count as its root mean square. NaN: not measured. */
    double slope, volume_slope;
    size_t slope_param, volume_slope_param;
    /* the same of every parameter */
    double slopes[SDM_POD_MAX_PARAMS], volume_slopes[SDM_POD_MAX_PARAMS];
} derivative_check;

/* Measures m. Computes about 64 exact maps, or two for each parameter if that is more. A model
 * whose derivatives and the maps to compare them with take more than 1 GB, or whose
   network is slow (t->kind->slow), has its volumes measured only. [t->n_threads threads; the same
   bits for any number] */
sdm_status trainer_derivative_check(const trainer *t, const sdm_model *m, derivative_check *out,
                                    sdm_error *err);

/* Sets *out to figures that are not known. */
void trainer_derivatives_unknown(derivative_check *out);
