/* Parts of sdm_shape_measure(): the measures that every shape has from its mesh, and a shape's own.
 */
#pragma once

#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { SDM_MESH_MEASURES = 5 };

/* Volume, area and extents, in the order in which sdm_shape_measure() adds them. */
extern const sdm_measure sdm_mesh_measures[SDM_MESH_MEASURES];

/* As sdm_shape_measure(), but without the measures of the mesh, which take most of the time. [any
 * thread] */
sdm_status sdm_shape_measure_own(const sdm_instance *s, const double *p, const double *depths,
                                 size_t n_depths, sdm_measures *out, sdm_error *err);

#ifdef __cplusplus
}
#endif
