/* Tells a shape that was changed after the training of a model. */
#include "sdm/internal/model_mesh.h"

#include <math.h>

#include "sdm/internal/shape_sums.h"
#include "sdm/memory.h"

/* Largest relative difference of volume and area between compilers and processors. */
static const double SAME_MESH = 1e-6;

/* Volume over area^(3/2) below which a shape counts as thin: its volume is a small difference. Of a
 * ball it is 0.094. */
static const double THIN_VOLUME = 0.01;

/* The shape at p against the figures of its mesh at the training; moment NaN: not known. */
static sdm_status compare(const sdm_model_info *info, const sdm_instance *shape, const double *p,
                          const sdm_shape_figures *then, const char *where, sdm_error *err)
{
    sdm_shape_figures now;
    const sdm_status s = sdm_shape_sums(shape, p, &now, err);
    const double cube = then->area * sqrt(then->area);
    if (s) return s;
    if (fabs(now.area - then->area) > SAME_MESH * then->area ||
        fabs(now.volume - then->volume) > SAME_MESH * fmax(fabs(then->volume), THIN_VOLUME * cube))
        return sdm_fail(err, SDM_E_PLUGIN,
                        "shape '%s' was changed after the training: at %s parameters its mesh has "
                        "%.6g mm^3 and %.6g mm^2, at the training %.6g mm^3 and %.6g mm^2 (sums "
                        "over all triangles: overlaps count twice); load the shape of that time, "
                        "or train again",
                        info->shape, where, now.volume, now.area, then->volume, then->area);
    if (fabs(now.moment - then->moment) > SAME_MESH * fmax(fabs(then->moment), cube))
        return sdm_fail(err, SDM_E_PLUGIN,
                        "shape '%s' was changed after the training: at %s parameters its mesh has "
                        "the same volume and area, but at least a part of it lies elsewhere; load "
                        "the shape of that time, or train again",
                        info->shape, where);
    return SDM_OK;
}

sdm_status sdm_model_mesh_check(const sdm_model_info *info, const sdm_instance *shape,
                                sdm_error *err)
{
    const sdm_model_quality *q = &info->quality;
    double *p = NULL;
    if (isnan(q->mesh_volume_mm3)) return SDM_OK; // a model of an earlier version
    sdm_status s = SDM_ALLOC(&p, info->n_params, "parameters", err);
    for (size_t i = 0; i < info->n_params && !s; i++) p[i] = info->params[i].def;
    const sdm_shape_figures f = {q->mesh_volume_mm3, q->mesh_area_mm2, q->mesh_moment_mm3};
    if (!s) s = compare(info, shape, p, &f, "the default", err);
    for (size_t k = 0; k < SDM_MODEL_PROBES && !s && !isnan(q->probe_volume_mm3[k]); k++) {
        for (size_t i = 0; i < info->n_params; i++)
            p[i] = sdm_probe_param(k, i, info->params[i].min, info->params[i].max);
        const sdm_shape_figures at = {q->probe_volume_mm3[k], q->probe_area_mm2[k],
                                      q->probe_moment_mm3[k]};
        s = compare(info, shape, p, &at, "other", err);
    }
    sdm_free(p);
    return s;
}
