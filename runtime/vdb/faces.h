/* Distances outside the grid of a map, computed from the distances d at the faces of the box that
   its voxels fill. Internal to the level set library. */
#pragma once

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Enough levels for any grid: n points along an axis need 1 + log2 n. */
#define SDM_FACE_LEVELS 64

/* One face of the box. Its points b lie half a voxel beyond the outermost voxel centres. Level 0
   holds max(d(b), 0) at the points, level l the minimum over squares of 2^l x 2^l points. */
typedef struct sdm_face {
    int levels;
    /* Numbers of squares of each level along the two axes that follow the axis of the face. */
    int64_t n[SDM_FACE_LEVELS][2];
    double *min[SDM_FACE_LEVELS];
    /* The nearest point of the last search: a good start for the next voxel. */
    int64_t last[2];
} sdm_face;

typedef struct sdm_faces {
    double voxel; /* edge of a voxel, mm */
    int64_t n[3];
    sdm_face face[6]; /* low and high along x, y, z */
} sdm_faces;

/* The faces of values[nz][ny][nx] on uniform voxels. Call sdm_faces_dispose() also after an error.
   SDM_E_NOMEM. */
sdm_status sdm_faces_create(const sdm_grid *g, const float *values, sdm_faces *out, sdm_error *err);
void sdm_faces_dispose(sdm_faces *f);

/* Distance (mm) at voxel index p outside the grid: the minimum of |p - b| + max(d(b), 0) over the
   points b of all faces whose outer side p lies on; `max` if `max` is smaller. A point with d(b) <=
   0 stands for its whole voxel face, which belongs to the solid: |p - b| is then the distance to
   the face of that voxel. */
double sdm_faces_distance(sdm_faces *f, const int64_t p[3], double max);

#ifdef __cplusplus
}
#endif
