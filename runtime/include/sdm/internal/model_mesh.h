/* Is a shape the one of the training of a model? */
#pragma once

#include "sdm/model.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* SDM_E_PLUGIN unless the mesh at the default parameters has volume and area of the training (to
 * 1e-6), if the model knows them. Errors of sdm_instance_mesh(). [any thread] */
sdm_status sdm_model_mesh_check(const sdm_model_info *info, const sdm_instance *shape,
                                sdm_error *err);

#ifdef __cplusplus
}
#endif
