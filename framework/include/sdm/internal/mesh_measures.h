/* The measures that every shape has from its mesh. */
#pragma once

#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SDM_MESH_MEASURES = 5 };

/* Volume, area and extents, in the order in which sdm_shape_measure() adds them. */
extern const sdm_measure sdm_mesh_measures[SDM_MESH_MEASURES];

#ifdef __cplusplus
}
#endif
