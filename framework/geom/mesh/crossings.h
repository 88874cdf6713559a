/* Integer winding numbers of closed meshes by signed crossings of axis-parallel rays. */
#pragma once

#include "bvh.h"

/* Casts a ray from p along `axis` (0..2) in `direction` (+1 or -1) and returns the number of
 * triangles through which it leaves minus the number through which it enters: on a closed mesh, the
 * winding number of p. The ray is moved by an infinitesimal vector (predicates.h), so it never
 * meets an edge or a corner. The triangles skip[n_skip] (indices in m) do not count. */
int sdm_ray_winding(const sdm_mesh *m, const sdm_bvh *tree, const double p[3], int axis,
                    int direction, const uint32_t *skip, size_t n_skip);

/* The same for a ray along the coordinate axis and direction closest to the vector n. */
int sdm_ray_winding_along(const sdm_mesh *m, const sdm_bvh *tree, const double p[3],
                          const double n[3], const uint32_t *skip, size_t n_skip);

/* The same for a ray along x; the triangles of the parts a and b do not count. part_of[triangle]:
 * number of its part. */
int sdm_ray_winding_of_others(const sdm_mesh *m, const sdm_bvh *tree, const double p[3],
                              const uint32_t *part_of, uint32_t a, uint32_t b);
