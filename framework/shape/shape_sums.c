/* Volume and area of a mesh as sums over its triangles. */
#include "sdm/internal/shape_sums.h"

#include <math.h>

#include "sdm/internal/part_audit.h"

sdm_status sdm_shape_sums(const sdm_instance *shape, const double *p, double *volume, double *area,
                          sdm_error *err)
{
    sdm_mesh m = {0};
    const sdm_status s = sdm_instance_mesh(shape, p, &m, err);
    sdm_mesh_sums(&m, volume, area); // an empty mesh after an error
    sdm_mesh_dispose(&m);
    return s;
}

double sdm_probe_param(size_t i, size_t k, double min, double max)
{
    // a Kronecker sequence: multiples of irrational numbers, another one for each parameter
    const double GOLDEN = 0.6180339887498949;
    double whole;
    const double step = modf(GOLDEN * (double)(k + 1), &whole);
    return min + modf(0.35 + step * (double)(i + 1), &whole) * (max - min);
}
