/* Tools for tests of signs of whole maps: engines and maps that must succeed, rotated grids, and
 * winding numbers by a formula that differs from the engine's. */
#ifndef SDM_TEST_SIGN_CHECK_H
#define SDM_TEST_SIGN_CHECK_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/exact.h"
#include "sdm/internal/rng.h"

static const double zero[3] = {0, 0, 0};

static inline double uniform(uint64_t stream, uint64_t i, double lo, double hi)
{
    return lo + (hi - lo) * sdm_rng_uniform(29, stream, i);
}

static inline sdm_exact *engine(const sdm_mesh *m, sdm_sign_method sign, int n_threads)
{
    sdm_exact *e = NULL;
    sdm_error err = {0};
    if (sdm_exact_create(m, &(sdm_exact_opts){.sign = sign, .n_threads = n_threads}, &e, &err))
        fail_msg("%s", err.text);
    return e;
}

static inline float *map(const sdm_exact *e, const sdm_grid *g)
{
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    sdm_error err = {0};
    if (!v || sdm_exact_map(e, g, v, &err)) fail_msg("%s", err.text);
    return v;
}

/* Position of voxel i of a map values[nz][ny][nx]. */
static inline void voxel(const sdm_grid *g, size_t i, double x[3])
{
    const int64_t v = (int64_t)i;
    const double index[3] = {(double)(v % g->n[0]), (double)(v / g->n[0] % g->n[1]),
                             (double)(v / g->n[0] / g->n[1])};
    sdm_grid_world(g, index, x);
}

/* Random rotation matrix, orthonormal to rounding. mirrored: the first column is negated (a
 * reflection). */
static inline void rotation(uint64_t seed, bool mirrored, double r[9])
{
    double q[4];
    for (uint64_t k = 0; k < 4; k++) q[k] = uniform(1, 4 * seed + k, -1, 1);
    quaternion_rotation(q, r);
    for (int i = 0; mirrored && i < 9; i += 3) r[i] = -r[i];
}

/* Winding number: sum of the solid angles of all triangles over 4 pi, by the dot products of unit
 * vectors (Eriksson 1990), which is not the engine's formula. */
static inline double winding(const sdm_mesh *m, const double x[3])
{
    double sum = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        double u[3][3], c[3];
        for (size_t k = 0; k < 3; k++) {
            double l = 0;
            for (size_t a = 0; a < 3; a++) {
                u[k][a] = m->vert[3 * (size_t)m->tri[3 * t + k] + a] - x[a];
                l += u[k][a] * u[k][a];
            }
            for (size_t a = 0; a < 3; a++) u[k][a] /= sqrt(l);
        }
        for (int k = 0; k < 3; k++) {
            const double *p = u[k], *q = u[(k + 1) % 3];
            c[k] = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        }
        const double det = u[0][0] * (u[1][1] * u[2][2] - u[1][2] * u[2][1]) -
                           u[0][1] * (u[1][0] * u[2][2] - u[1][2] * u[2][0]) +
                           u[0][2] * (u[1][0] * u[2][1] - u[1][1] * u[2][0]);
        sum += 2 * atan2(det, 1 + c[0] + c[1] + c[2]);
    }
    return sum / (4 * 3.14159265358979323846);
}

/* Removes all triangles whose centroid satisfies `drop`. */
static inline void drop_triangles(sdm_mesh *m, bool (*drop)(const double middle[3]))
{
    size_t n = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        double c[3] = {0, 0, 0};
        for (size_t k = 0; k < 9; k++)
            c[k % 3] += m->vert[3 * (size_t)m->tri[3 * t + k / 3] + k % 3] / 3;
        if (!drop(c)) mesh_triangle(m, n++, m->tri[3 * t], m->tri[3 * t + 1], m->tri[3 * t + 2]);
    }
    m->n_tri = n;
}

static inline bool above(const double c[3]) { return c[2] > 0.61; }

#endif
