/* The surface on which a map has a given value. */
#ifndef SDM_ISOSURFACE_H
#define SDM_ISOSURFACE_H

#include "sdm/grid.h"
#include "sdm/mesh.h"
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The iso-surface at `level` by marching cubes (Lorensen and Cline 1987), closed wherever it does
   not leave the grid, normals towards larger values, vertices shared. *cut (may be NULL): true when
   the surface leaves the grid. *out is zero-initialised; it has no triangle when nothing crosses
   the level. World coordinates, mm. The same bits in every call. */
SDM_API sdm_status sdm_isosurface(const sdm_grid *grid, const float *values, float level,
                                  sdm_mesh *out, bool *cut, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
