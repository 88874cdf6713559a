/* Which triangles turn from one mesh to another, and by how much. */
#pragma once

#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Returns the share of the surface that turns by `angle` (rad, 0 .. 3), to 0.5 %, of the surface
 * that turns by any angle, and sets *vertex to a vertex of it. Triangles that change their edges,
 * or go on without turning, count in neither. 0: nothing turns, or the meshes have different
 * triangles. [any thread] */
double sdm_mesh_turned(const sdm_mesh *from, const sdm_mesh *to, double angle, size_t *vertex);

#ifdef __cplusplus
}
#endif
