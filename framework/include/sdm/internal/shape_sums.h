/* Two figures by which a shape that was changed is told from the one of a training. */
#pragma once

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The sums of sdm_mesh_sums() of the mesh at p; 0 after an error, which is one of
 * sdm_instance_mesh(). [any thread] */
sdm_status sdm_shape_sums(const sdm_instance *shape, const double *p, double *volume, double *area,
                          sdm_error *err);

/* Value of parameter k at the probe `i` of a model, 0 .. SDM_MODEL_PROBES - 1: a fixed place inside
 * the range min .. max, another one for each parameter. */
double sdm_probe_param(size_t i, size_t k, double min, double max);

#ifdef __cplusplus
}
#endif
