/* Derivative of the signed distance at a point with respect to the vertices of the mesh. */
#pragma once

#include <stdbool.h>

#include "features/nearest.h"

/* A surface and the mesh from which it was made: each triangle of the surface is a triangle of the
 * mesh or a piece of one. A sheet is a mesh triangle that has such pieces. */
typedef struct sdm_sheets {
    const sdm_nearest *surface;
    const sdm_mesh *mesh;
    const sdm_frame *frames; /* [mesh->n_tri] frames of the triangles of mesh */
    const uint32_t *source;  /* source[triangle of the surface] = triangle of the mesh */
    /* pieces of different triangles that meet are at most this far apart, mm; 0: no triangle was
     * cut */
    double seam;
} sdm_sheets;

/* Derivatives d[i][3] of the distance with respect to the position of vertex[i], i < n. A vertex
 * may occur more than once: the derivatives add up. */
#define SDM_GRADIENT_VERTICES 12
typedef struct sdm_vertex_gradient {
    int n;
    uint32_t vertex[SDM_GRADIENT_VERTICES];
    double d[SDM_GRADIENT_VERTICES][3];
} sdm_vertex_gradient;

/* Writes frames[m->n_tri], the frames of the triangles of a mesh. */
void sdm_sheets_frames(const sdm_mesh *m, int n_threads, sdm_frame *frames);

/* Computes the derivatives of the signed distance at a point x. triangle, feature, q: nearest
 * triangle of the surface, where on it the nearest point lies (point_triangle.h), and that point;
 * normal: gradient of the signed distance with respect to x; inside: the distance is negative. [any
 * thread] */
void sdm_vertex_gradient_find(const sdm_sheets *s, uint32_t triangle, int feature,
                              const double q[3], const double normal[3], bool inside,
                              sdm_vertex_gradient *out);

/* The derivative of the distance when the vertices of the mesh move with velocity[n_vert][3]. */
double sdm_vertex_gradient_along(const sdm_vertex_gradient *g, const double *velocity);
