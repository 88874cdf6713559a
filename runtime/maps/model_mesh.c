/* Tells a shape that was changed after the training of a model. */
#include "sdm/internal/model_mesh.h"

#include <math.h>

#include "sdm/internal/shape_sums.h"
#include "sdm/memory.h"

/* Largest relative difference of volume and area between compilers and processors. */
static const double SAME_MESH = 1e-6;

sdm_status sdm_model_mesh_check(const sdm_model_info *info, const sdm_instance *shape,
                                sdm_error *err)
{
    const double volume = info->quality.mesh_volume_mm3, area = info->quality.mesh_area_mm2;
    double *p = NULL, v, a;
    if (isnan(volume)) return SDM_OK; // a model of an earlier version
    sdm_status s = SDM_ALLOC(&p, info->n_params, "parameters", err);
    for (size_t i = 0; i < info->n_params && !s; i++) p[i] = info->params[i].def;
    if (!s) s = sdm_shape_sums(shape, p, &v, &a, err);
    sdm_free(p);
    if (s || (fabs(a - area) <= SAME_MESH * area &&
              fabs(v - volume) <= SAME_MESH * fmax(fabs(volume), area * sqrt(area))))
        return s;
    return sdm_fail(err, SDM_E_PLUGIN,
                    "shape '%s' was changed after the training: at the default parameters its mesh "
                    "has %.6g mm^3 and %.6g mm^2, at the training %.6g mm^3 and %.6g mm^2; load "
                    "the shape of that time, or train again",
                    info->shape, v, a, volume, area);
}
