/* Meshes for tests and benchmarks of the exact engine: boxes, spheres, and a self-overlapping tube
 * along a spiral; with closed-form distances for some of them. */
#ifndef SDM_TEST_EXACT_MESHES_H
#define SDM_TEST_EXACT_MESHES_H

#include <math.h>
#include <stdlib.h>

#include "sdm/mesh.h"

static inline void mesh_make(sdm_mesh *m, size_t n_vert, size_t n_tri)
{
    if (sdm_mesh_reserve(m, n_vert, n_tri, NULL)) abort();
}

static inline void mesh_vertex(sdm_mesh *m, size_t v, double x, double y, double z)
{
    m->vert[3 * v] = x;
    m->vert[3 * v + 1] = y;
    m->vert[3 * v + 2] = z;
}

static inline void mesh_triangle(sdm_mesh *m, size_t t, size_t a, size_t b, size_t c)
{
    m->tri[3 * t] = (uint32_t)a;
    m->tri[3 * t + 1] = (uint32_t)b;
    m->tri[3 * t + 2] = (uint32_t)c;
}

static inline void mesh_flip(sdm_mesh *m)
{
    for (size_t t = 0; t < m->n_tri; t++)
        mesh_triangle(m, t, m->tri[3 * t], m->tri[3 * t + 2], m->tri[3 * t + 1]);
}

/* Appends a copy of b to a. */
static inline void mesh_append(sdm_mesh *a, const sdm_mesh *b)
{
    const size_t nv = a->n_vert, nt = a->n_tri;
    mesh_make(a, nv + b->n_vert, nt + b->n_tri);
    for (size_t i = 0; i < 3 * b->n_vert; i++) a->vert[3 * nv + i] = b->vert[i];
    for (size_t i = 0; i < 3 * b->n_tri; i++) a->tri[3 * nt + i] = b->tri[i] + (uint32_t)nv;
}

/* Rotation matrix r (row-major) of a quaternion (w, x, y, z) of any length but 0; orthonormal to
 * rounding. */
static inline void quaternion_rotation(const double q[4], double r[9])
{
    const double len = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    const double w = q[0] / len, x = q[1] / len, y = q[2] / len, z = q[3] / len;
    const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                         2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                         2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
    for (int i = 0; i < 9; i++) r[i] = m[i];
}

/* Signed distance from x to the box with corners lo and hi; negative inside. */
static inline double box_distance(const double x[3], const double lo[3], const double hi[3])
{
    double out = 0, in = -INFINITY;
    for (int a = 0; a < 3; a++) {
        const double d = fmax(lo[a] - x[a], x[a] - hi[a]);
        if (d > 0) out += d * d;
        in = fmax(in, d);
    }
    return in > 0 ? sqrt(out) : in;
}

/* Box from corner lo to corner hi, 12 triangles. */
static inline void mesh_box(sdm_mesh *m, const double lo[3], const double hi[3])
{
    static const uint8_t quad[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                       {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    mesh_make(m, 8, 12);
    for (size_t v = 0; v < 8; v++)
        mesh_vertex(m, v, v & 1 ? hi[0] : lo[0], v & 2 ? hi[1] : lo[1], v & 4 ? hi[2] : lo[2]);
    for (size_t q = 0; q < 6; q++) {
        mesh_triangle(m, 2 * q, quad[q][0], quad[q][1], quad[q][2]);
        mesh_triangle(m, 2 * q + 1, quad[q][0], quad[q][2], quad[q][3]);
    }
}

/* Sphere of n latitude bands and 2 n meridians; all vertices lie on the sphere. */
static inline void mesh_sphere(sdm_mesh *m, const double centre[3], double radius, size_t n)
{
    const double pi = 3.14159265358979323846;
    const size_t around = 2 * n, rings = n - 1;
    mesh_make(m, rings * around + 2, 2 * rings * around);
    mesh_vertex(m, 0, centre[0], centre[1], centre[2] + radius);
    mesh_vertex(m, 1, centre[0], centre[1], centre[2] - radius);
    for (size_t i = 0; i < rings; i++) {
        const double a = pi * (double)(i + 1) / (double)n;
        for (size_t j = 0; j < around; j++) {
            const double b = 2 * pi * (double)j / (double)around;
            mesh_vertex(m, 2 + i * around + j, centre[0] + radius * sin(a) * cos(b),
                        centre[1] + radius * sin(a) * sin(b), centre[2] + radius * cos(a));
        }
    }
    size_t t = 0;
    for (size_t j = 0; j < around; j++) {
        const size_t k = (j + 1) % around, last = 2 + (rings - 1) * around;
        mesh_triangle(m, t++, 0, 2 + j, 2 + k);
        mesh_triangle(m, t++, 1, last + k, last + j);
        for (size_t i = 0; i + 1 < rings; i++) {
            const size_t a = 2 + i * around, b = a + around;
            mesh_triangle(m, t++, a + j, b + j, b + k);
            mesh_triangle(m, t++, a + j, b + k, a + k);
        }
    }
}

/* Model of a cochlea: a tube around a logarithmic spiral of radius a exp(-b theta), 0 <= theta <=
 * end, with a longitudinal wave (amplitude alpha, phase phi) and a widened start (flare, mm). */
typedef struct spiral {
    double a, b, alpha, phi, end, flare;
} spiral;

#define SPIRAL_NOMINAL ((spiral){4.4, 0.145, 0.5, 0.4, 14.5, 0.25})

static inline double spiral_centre(const spiral *s, double theta, double c[3], double tangent[3])
{
    const double r = s->a * exp(-s->b * theta), wave = s->alpha * exp(-0.3 * theta);
    c[0] = r * cos(theta);
    c[1] = r * sin(theta);
    c[2] = 0.20 * theta + wave * cos(theta - s->phi);
    tangent[0] = r * (-s->b * cos(theta) - sin(theta));
    tangent[1] = r * (-s->b * sin(theta) + cos(theta));
    tangent[2] = 0.20 + wave * (-0.3 * cos(theta - s->phi) - sin(theta - s->phi));
    const double len =
        sqrt(tangent[0] * tangent[0] + tangent[1] * tangent[1] + tangent[2] * tangent[2]);
    for (int i = 0; i < 3; i++) tangent[i] /= len;
    return len;
}

static inline double spiral_radius(const spiral *s, double theta)
{
    return 1.11 - 0.02 * theta + s->flare * exp(-theta / 0.35);
}

/* Signed distance to the union of spheres along the centreline: min over theta of norm(x - c) - R.
 * Exact outside; inside it is only a bound. */
static inline double spiral_distance(const spiral *s, const double x[3])
{
    double best = INFINITY, at = 0;
    const int n = 1000;
    for (int pass = 0; pass < 3; pass++) {
        // sample the whole centreline, then twice around the best sample
        const double half = pass == 0 ? s->end / 2 : pass == 1 ? s->end / n : s->end / n / 50;
        const double mid = pass == 0 ? s->end / 2 : at;
        for (int i = 0; i <= n; i++) {
            double theta = mid - half + 2 * half * i / n, c[3], t[3];
            theta = theta < 0 ? 0 : theta > s->end ? s->end : theta;
            (void)spiral_centre(s, theta, c, t);
            const double dx = x[0] - c[0], dy = x[1] - c[1], dz = x[2] - c[2];
            const double d = sqrt(dx * dx + dy * dy + dz * dz) - spiral_radius(s, theta);
            if (d < best) {
                best = d;
                at = theta;
            }
        }
    }
    return best;
}

/* Tube with edges of about `edge` mm and spherical caps at both ends. */
static inline void mesh_spiral(sdm_mesh *m, const spiral *s, double edge)
{
    const double pi = 3.14159265358979323846;
    // rings are equally spaced along the centreline
    const int fine = 20000;
    double *length = malloc(sizeof *length * (size_t)(fine + 1));
    if (!length) abort();
    double c[3], t[3];
    length[0] = 0;
    for (int i = 0; i < fine; i++)
        length[i + 1] =
            length[i] + spiral_centre(s, s->end * (i + 0.5) / fine, c, t) * s->end / fine;
    const size_t along = (size_t)ceil(length[fine] / edge),
                 around = (size_t)ceil(2 * pi * 1.0 / edge);
    const size_t cap = (size_t)ceil(0.5 * pi / edge), rings = along + 1 + 2 * (cap - 1);
    mesh_make(m, rings * around + 2, 2 * rings * around);
    size_t ring = 0;
    int at = 0;
    for (size_t i = 0; i < rings; i++, ring++) {
        const size_t mid = i < cap - 1 ? 0 : i > along + cap - 1 ? along : i - (cap - 1);
        while (at < fine && length[at] < length[fine] * (double)mid / (double)along) at++;
        const double theta = s->end * at / fine, r = spiral_radius(s, theta);
        (void)spiral_centre(s, theta, c, t);
        const double bend = i < cap - 1 ? pi / 2 * (1 - (double)(i + 1) / (double)cap)
                            : i > along + cap - 1
                                ? pi / 2 * (double)(i - along - cap + 1) / (double)cap
                                : 0;
        const double shift = (i < cap - 1 ? -r : r) * sin(bend), radius = r * cos(bend);
        const double flat = sqrt(t[0] * t[0] + t[1] * t[1]);
        const double e1[3] = {t[1] / flat, -t[0] / flat, 0};
        const double e2[3] = {e1[1] * t[2] - e1[2] * t[1], e1[2] * t[0] - e1[0] * t[2],
                              e1[0] * t[1] - e1[1] * t[0]};
        for (size_t j = 0; j < around; j++) {
            const double b = 2 * pi * ((double)j + 0.5 * (double)(i % 2)) / (double)around;
            double x[3];
            for (int k = 0; k < 3; k++)
                x[k] = c[k] + shift * t[k] + radius * (cos(b) * e1[k] + sin(b) * e2[k]);
            mesh_vertex(m, i * around + j, x[0], x[1], x[2]);
        }
    }
    for (size_t end = 0; end < 2; end++) {
        const double theta = end ? s->end : 0,
                     r = end ? spiral_radius(s, theta) : -spiral_radius(s, theta);
        (void)spiral_centre(s, theta, c, t);
        mesh_vertex(m, rings * around + end, c[0] + r * t[0], c[1] + r * t[1], c[2] + r * t[2]);
    }
    free(length);
    size_t n = 0;
    for (size_t j = 0; j < around; j++) {
        const size_t k = (j + 1) % around;
        mesh_triangle(m, n++, rings * around, k, j);
        mesh_triangle(m, n++, rings * around + 1, (rings - 1) * around + j,
                      (rings - 1) * around + k);
        for (size_t i = 0; i + 1 < rings; i++) {
            const size_t a = i * around, b = a + around;
            if (i % 2 == 0) {
                mesh_triangle(m, n++, a + j, a + k, b + j);
                mesh_triangle(m, n++, a + k, b + k, b + j);
            } else {
                mesh_triangle(m, n++, a + j, b + k, b + j);
                mesh_triangle(m, n++, a + j, a + k, b + k);
            }
        }
    }
    m->n_tri = n;
    mesh_flip(m);
}

#endif
