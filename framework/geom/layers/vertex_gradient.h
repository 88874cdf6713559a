/* How the signed distance at a point changes when the vertices of the mesh move. */
#ifndef SDM_GEOM_VERTEX_GRADIENT_H
#define SDM_GEOM_VERTEX_GRADIENT_H

#include <stdbool.h>

#include "features/nearest.h"

/* A surface and the mesh whose triangles it consists of, whole or cut. */
typedef struct sdm_sheets {
    const sdm_nearest *surface;
    const sdm_mesh *mesh;
    const sdm_frame *frames; /* [mesh->n_tri] */
    const uint32_t *source;  /* triangle of the mesh for each triangle of the surface */
    double seam; /* pieces of different triangles meet to within this length; 0: nothing was cut */
} sdm_sheets;

/* Derivatives with respect to vertices that may occur more than once. */
#define SDM_GRADIENT_VERTICES 12
typedef struct sdm_vertex_gradient {
    int n;
    uint32_t vertex[SDM_GRADIENT_VERTICES];
    double d[SDM_GRADIENT_VERTICES][3];
} sdm_vertex_gradient;

/* Frames of the triangles of a mesh. */
void sdm_sheets_frames(const sdm_mesh *m, int n_threads, sdm_frame *frames);

/* slot, feature, q: nearest triangle and point of the surface; normal: gradient of the signed
   distance with respect to the point; inside: the distance is negative. */
void sdm_vertex_gradient_find(const sdm_sheets *s, uint32_t slot, int feature, const double q[3],
                              const double normal[3], bool inside, sdm_vertex_gradient *out);

#endif
