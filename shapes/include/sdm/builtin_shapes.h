/* The shapes that are built into the library (list: shapes/shapes.def). */
#ifndef SDM_BUILTIN_SHAPES_H
#define SDM_BUILTIN_SHAPES_H

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Adds all built-in shapes to a registry, in the order of shapes.def. SDM_E_PLUGIN if a name exists
 * already, SDM_E_NOMEM. */
SDM_API sdm_status sdm_builtin_shapes_add(sdm_registry *registry, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
