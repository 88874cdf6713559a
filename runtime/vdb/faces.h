/* Distances beyond the grid of a map, from the faces of its box. Internal to the level set library.
 */
#ifndef SDM_FACES_H
#define SDM_FACES_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* More than any row of points needs. */
#define SDM_FACE_LEVELS 64

/* One face of the box: the distance d(b) at its points b, half a voxel beyond the outermost
   centres, and the minima of squares of 2, 4, 8
   ... points to a side. */
typedef struct sdm_face {
    int levels;
    int64_t n[SDM_FACE_LEVELS]
             [2]; /* squares of a level, along the two axes after that of the face */
    double *least[SDM_FACE_LEVELS];
    int64_t last[2]; /* the point found last: the next voxel's is most often near */
} sdm_face;

typedef struct sdm_faces {
    double voxel; /* mm */
    int64_t n[3];
    sdm_face face[6]; /* low and high along x, y, z */
} sdm_faces;

/* Of values[nz][ny][nx] on uniform voxels. sdm_faces_dispose() frees it in every case. SDM_E_NOMEM.
 */
sdm_status sdm_faces_create(const sdm_grid *g, const float *values, sdm_faces *out, sdm_error *err);
void sdm_faces_dispose(sdm_faces *f);

/* min over the faces that voxel p outside of the grid sees, and their points b, of |p - b| +
 * max(d(b), 0), mm; at most `most`. */
double sdm_faces_distance(sdm_faces *f, const int64_t p[3], double most);

#ifdef __cplusplus
}
#endif
#endif
