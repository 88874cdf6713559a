/* Places spread over the triangles of a mesh. */
#pragma once

#include "sdm/mesh.h"

/* points[n][3] = places with equal shares of the area of the mesh, in the order of its triangles;
   triangle[n] (NULL: not wanted): on which each of them lies. Place i lies where the multiple
   i * turn[0] says within its share, and i * turn[1] across its triangle. Returns the area, mm^2;
   nothing is written unless it is positive and finite. */
double sdm_fit_spread_over(const sdm_mesh *m, size_t n, const double turn[2], double *points,
                           uint32_t *triangle);
