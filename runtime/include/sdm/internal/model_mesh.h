/* Is a shape the one of the training of a model? */
#pragma once

#include "sdm/model.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Compares the mesh of the shape at the default parameters with that of the training: SDM_E_PLUGIN
 * if its volume or its area differs by more than 1e-6 from the values in the model; SDM_OK if the
 * model has none. Errors of sdm_instance_mesh(). [any thread] */
sdm_status sdm_model_mesh_check(const sdm_model_info *info, const sdm_instance *shape,
                                sdm_error *err);

#ifdef __cplusplus
}
#endif
