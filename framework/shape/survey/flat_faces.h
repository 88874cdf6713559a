/* Flat faces of meshes that are perpendicular to an axis of a grid. */
#pragma once

#include "sdm/grid.h"
#include "sdm/registry.h"

/* The triangles of a mesh that lie in one plane perpendicular to an axis. */
typedef struct flat_face {
    double at, area; /* coordinate along the axis, mm; area, mm^2 */
} flat_face;

typedef struct face_list {
    flat_face *face; /* [n] at ascending coordinates */
    size_t n;
} face_list;

/* Zero-initialise; flat_faces_dispose() frees. */
typedef struct flat_faces {
    face_list along[3]; /* by the axis of the grid */
    double area;        /* of the whole mesh, mm^2; of several the largest */
    double volume;      /* that it encloses, mm^3; of several the smallest */
} flat_faces;

/* Coordinate of the point x along an axis of the grid, mm. */
static inline double grid_coordinate(const sdm_grid *g, int axis, const double x[3])
{
    return g->dir[axis] * x[0] + g->dir[3 + axis] * x[1] + g->dir[6 + axis] * x[2];
}

/* Sum of the areas, mm^2. */
static inline double face_list_area(const face_list *list)
{
    double sum = 0;
    for (size_t i = 0; i < list->n; i++) sum += list->face[i].area;
    return sum;
}

/* The faces of one mesh. SDM_E_NOMEM; *out is disposed of by the caller in any case. */
sdm_status flat_faces_find(const sdm_mesh *m, const sdm_grid *g, flat_faces *out, sdm_error *err);

/* The faces that have the same place in `samples` random shapes (Sobol' points), with the smallest
 * area of each. range: of each parameter; NULL: those of the shape. Errors as sdm_shape_box(); *out
 * is disposed of by the caller in any case. */
sdm_status flat_faces_staying(const sdm_instance *shape, const double (*range)[2], size_t samples,
                              uint64_t seed, const sdm_grid *g, flat_faces *out, sdm_error *err);

void flat_faces_dispose(flat_faces *f);
