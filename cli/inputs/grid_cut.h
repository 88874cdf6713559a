/* Warns of a grid that cuts a shape or whose voxels do not show it. */
#pragma once

#include <stdbool.h>

#include "sdm/blocks.h"
#include "sdm/mesh.h"

/* Warns in one line if the mesh reaches beyond the outer voxel centres of the grid: names the faces
 * and how far the shape reaches beyond each. mend: what the user can do. */
void cli_warn_cut_shape(const sdm_grid *g, const sdm_mesh *mesh, const char *mend);

/* The same of a map: how far the shape reaches beyond the grid is known at least, since a point
 * that lies `depth` inside has a ball of this radius about it that is inside, too. `where` begins
 * the line: "" or "row 2: ". */
void cli_warn_cut_map(const char *where, const sdm_grid *g, const float *values, const char *mend);

/* Warns in one line if the surface of the map is torn: if it passes within half a voxel of voxels
 * beside which no voxel is inside, and some of these lie between voxels inside or over three voxels
 * from all of them. Something is thinner than a voxel there; the others lie beyond tips and edges.
 * Returns whether it warned. */
bool cli_warn_torn_map(const char *where, const sdm_grid *g, const float *values, const char *mend);
/* The same of a map in blocks. */
bool cli_warn_torn_blocks(const char *where, const sdm_blocks *b, const char *mend);
