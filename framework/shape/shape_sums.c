/* Volume and area of a mesh as sums over its triangles. */
#include "sdm/internal/shape_sums.h"

#include "sdm/internal/part_audit.h"

sdm_status sdm_shape_sums(const sdm_instance *shape, const double *p, double *volume, double *area,
                          sdm_error *err)
{
    sdm_mesh m = {0};
    const sdm_status s = sdm_instance_mesh(shape, p, &m, err);
    const double origin[3] = {0, 0, 0};
    *volume = *area = 0;
    for (size_t t = 0; t < m.n_tri && !s; t++) sdm_triangle_add(&m, t, origin, area, volume);
    sdm_mesh_dispose(&m);
    return s;
}
