/* The points and cells of a VTK polydata file, before they become triangles. */
#pragma once

#include "mesh_formats.h"

/* Cells: the corners of cell i are corner[offset[i]] .. corner[offset[i + 1] - 1], indices of
 * points. n_offset is the number of cells + 1, or 0. */
typedef struct sdm_vtk_cells {
    int64_t *offset, *corner;
    size_t n_offset, n_corner;
} sdm_vtk_cells;

typedef struct sdm_polydata {
    double *points; /* [n_points][3] */
    size_t n_points;
    sdm_vtk_cells polygons, strips;
} sdm_polydata;

/* Adds the points, the polygons as fans and the triangles of the strips to the builder.
 * SDM_E_FORMAT for a coordinate that is not finite, offsets that do not ascend, a corner that is no
 * point, a cell of fewer than three corners; errors of the builder. */
sdm_status sdm_polydata_build(const sdm_polydata *p, sdm_builder *b, sdm_error *err);

void sdm_vtk_cells_dispose(sdm_vtk_cells *cells);
void sdm_polydata_dispose(sdm_polydata *p);
