/* Figures by which a shape that was changed is told from the one of a training. */
#pragma once

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_shape_figures {
    double volume, area; /* of sdm_mesh_sums(), mm^3 and mm^2 */
    /* integral of x + 2 y + 4 z + (x (x + y) + 2 y (y + z) + 4 z (z + x)) / sqrt(area) over the
     * surface, mm^3. It changes where a part is moved, turned or mirrored, except by chance; it
     * stays where the same faces have other triangles. */
    double moment;
} sdm_shape_figures;

/* *out = the figures of the mesh at p; 0 after an error, which is one of sdm_instance_mesh(). [any
 * thread] */
sdm_status sdm_shape_sums(const sdm_instance *shape, const double *p, sdm_shape_figures *out,
                          sdm_error *err);

/* Value of parameter k at the probe `i` of a model, 0 .. SDM_MODEL_PROBES - 1: a fixed place inside
 * the range min .. max, another one for each parameter. */
double sdm_probe_param(size_t i, size_t k, double min, double max);

#ifdef __cplusplus
}
#endif
