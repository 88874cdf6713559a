/* Integer winding numbers of closed meshes by signed crossings of axis-parallel rays. */
#ifndef SDM_GEOM_CROSSINGS_H
#define SDM_GEOM_CROSSINGS_H

#include "bvh.h"

/* Sum over the triangles that the ray from p along `axis` (0..2) in `direction` (+1 or -1) leaves
   through (+1) or enters through (-1): the winding number of p where the mesh is closed. The ray is
   moved by an infinitely small amount, so it never meets an edge or a corner. The triangles
   skip[n_skip] are left out. */
int sdm_ray_winding(const sdm_mesh *m, const sdm_bvh *tree, const double p[3], int axis,
                    int direction, const uint32_t *skip, size_t n_skip);

/* The same of a ray along the axis nearest to the vector n. */
int sdm_ray_winding_along(const sdm_mesh *m, const sdm_bvh *tree, const double p[3],
                          const double n[3], const uint32_t *skip, size_t n_skip);

#endif
