/* Splines at all voxels of a grid whose axes are parallel to those of the map. Internal to the room
   `field`. */
#pragma once

#include "spline.h"

/* A grid in the frame of a map. */
typedef struct spline_grid {
    spline_axis axis[3]; /* along x, y, z of the grid */
    int32_t *memory;
} spline_grid;

/* The frame of a map. */
spline_frame sdm_spline_frame(const sdm_grid *map);

/* Whether every axis of `grid` is parallel to one of the map (to 1e-9). */
bool sdm_spline_is_parallel(const spline_frame *f, const sdm_grid *grid);

/* The places of the positions (i + offset) stride, i < n[a], along each axis of a parallel grid.
   Call sdm_spline_grid_dispose() also after an error. SDM_E_NOMEM. */
sdm_status sdm_spline_grid_create(const spline_shape *s, const spline_frame *f,
                                  const sdm_grid *grid, const int64_t n[3], double offset,
                                  double stride, spline_grid *out, sdm_error *err);
void sdm_spline_grid_dispose(spline_grid *g);

/* Positions of a piece of a row. */
#define SPLINE_PIECE 8

/* Pieces of the rows of a grid: first[0] ... along x of the grid, rows of coefficients first[1] ...
   and first[2] ... along the axes of the map that belong to y and z of the grid; n[3] of them. */
typedef struct spline_part {
    size_t first[3], n[3];
    const uint8_t *wanted; /* [n[2]][n[1]][n[0]]: 1 for pieces that are needed, else 0; NULL: all */
} spline_part;

/* rows[part->n[2]][part->n[1]][SPLINE_PIECE part->n[0]] = the coefficients interpolated along x.
   The last piece of a row may be shorter, its end stays unset. SDM_E_NOMEM. */
sdm_status sdm_spline_rows(const spline_shape *s, const spline_grid *g, const float *coefficient,
                           const spline_part *part, int n_threads, float *rows, sdm_error *err);

/* values[nz][ny][nx] = the spline at the voxels of a grid; beyond the box, at the nearest point of
   the box. Voxels at nodes get the value of map[] (NULL: that of the spline). SDM_E_NOMEM. */
sdm_status sdm_spline_map(const spline_shape *s, const spline_grid *g, const float *coefficient,
                          const float *map, int n_threads, float *values, sdm_error *err);

/* The index of voxel (i, j, k) of the grid in the map if all three are nodes; else -1. */
static inline int64_t sdm_spline_node(const spline_shape *s, const spline_grid *g,
                                      const int64_t at[3])
{
    int64_t voxel[3];
    for (int b = 0; b < 3; b++) {
        voxel[g->axis[b].axis] = g->axis[b].node[at[b]];
        if (g->axis[b].node[at[b]] < 0) return -1;
    }
    return (voxel[2] * s->n[1] + voxel[1]) * s->n[0] + voxel[0];
}
