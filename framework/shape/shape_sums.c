/* Figures of a mesh as sums over its triangles. */
#include "sdm/internal/shape_sums.h"

#include <math.h>

#include "sdm/internal/part_audit.h"
#include "sdm/internal/vec3.h"

static double moment_at(const double x[3], double size)
{
    const double square =
        x[0] * (x[0] + x[1]) + 2 * x[1] * (x[1] + x[2]) + 4 * x[2] * (x[2] + x[0]);
    return x[0] + 2 * x[1] + 4 * x[2] + square / size;
}

/* The mean over the midpoints of the edges of a triangle is exact for squares. */
static double moment_of(const sdm_mesh *m, double size)
{
    double sum = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const double *v[3];
        double normal[3], mean = 0;
        for (size_t k = 0; k < 3; k++) v[k] = m->vert + 3 * (size_t)m->tri[3 * t + k];
        v3_triangle_normal(v[0], v[1], v[2], normal);
        for (size_t k = 0; k < 3; k++) {
            double x[3];
            for (size_t d = 0; d < 3; d++) x[d] = (v[k][d] + v[(k + 1) % 3][d]) / 2;
            mean += moment_at(x, size) / 3;
        }
        sum += 0.5 * v3_norm(normal) * mean;
    }
    return sum;
}

sdm_status sdm_shape_sums(const sdm_instance *shape, const double *p, sdm_shape_figures *out,
                          sdm_error *err)
{
    sdm_mesh m = {0};
    *out = (sdm_shape_figures){0};
    const sdm_status s = sdm_instance_mesh(shape, p, &m, err);
    sdm_mesh_sums(&m, &out->volume, &out->area); // an empty mesh after an error
    if (out->area > 0) out->moment = moment_of(&m, sqrt(out->area));
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
