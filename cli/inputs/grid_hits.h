/* Tells which flat faces lie on planes of voxel centres. */
#pragma once

#include "sdm/grid.h"
#include "sdm/mesh.h"

/* A notice about the faces of the mesh, a warning if voxels are counted, with the --origin that
 * avoids them unless the grid is that of another file. Says nothing where there are none. */
void cli_tell_hits(const sdm_mesh *mesh, const sdm_grid *g, bool counted, bool has_origin);
