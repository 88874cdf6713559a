/* Volume and area of a mesh as sums over its triangles. */
#include "sdm/internal/shape_sums.h"

#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

sdm_status sdm_shape_sums(const sdm_instance *shape, const double *p, double *volume, double *area,
                          sdm_error *err)
{
    sdm_mesh m = {0};
    const sdm_status s = sdm_instance_mesh(shape, p, &m, err);
    double six = 0, twice = 0;
    for (size_t t = 0; t < m.n_tri && !s; t++) {
        const double *a = m.vert + 3 * (size_t)m.tri[3 * t],
                     *b = m.vert + 3 * (size_t)m.tri[3 * t + 1],
                     *c = m.vert + 3 * (size_t)m.tri[3 * t + 2];
        double normal[3];
        v3_triangle_normal(a, b, c, normal);
        six += v3_dot(a, normal);
        twice += v3_norm(normal);
    }
    *volume = six / 6;
    *area = twice / 2;
    sdm_mesh_dispose(&m);
    return s;
}
