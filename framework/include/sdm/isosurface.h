/* Extraction of iso-surfaces: the surface on which a map has a given value. */
#ifndef SDM_ISOSURFACE_H
#define SDM_ISOSURFACE_H

#include "sdm/grid.h"
#include "sdm/mesh.h"
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* *out = the iso-surface of values[nz][ny][nx] at `level` by marching cubes (Lorensen and Cline
 * 1987), in world coordinates, mm. It is closed except where it leaves the grid, its normals point
 * towards larger values, and triangles share vertices. It has no triangles if no value crosses the
 * level. *cut (may be NULL) = true if the surface leaves the grid. *out is zero-initialised by the
 * caller and empty after an error. Deterministic. SDM_E_ARG: NULL, an invalid grid, or a value or
 * level that is not finite; SDM_E_NOMEM, SDM_E_MESH (too large a mesh). */
SDM_API sdm_status sdm_isosurface(const sdm_grid *grid, const float *values, float level,
                                  sdm_mesh *out, bool *cut, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
