/* Random closed meshes for tests of the exact engine, from the project's counter-based random
 * numbers; and functions that move and reorder meshes. */
#ifndef SDM_TEST_RANDOM_SOLIDS_H
#define SDM_TEST_RANDOM_SOLIDS_H

#include <string.h>

#include "oracle/exact_meshes.h"
#include "sdm/internal/rng.h"

/* A sequence of random numbers, fixed by seed and stream; next: index of the next number. */
typedef struct dice {
    uint64_t seed, stream, next;
} dice;

/* Uniform in [lo, hi). */
static inline double roll(dice *d, double lo, double hi)
{
    return lo + (hi - lo) * sdm_rng_uniform(d->seed, d->stream, d->next++);
}
/* An integer, uniform in [0, n). */
static inline size_t pick(dice *d, size_t n)
{
    return (size_t)sdm_rng_below(d->seed, d->stream, d->next++, n);
}
/* 10^x with x uniform in [lo, hi). */
static inline double power_of_ten(dice *d, double lo, double hi)
{
    return pow(10, roll(d, lo, hi));
}

/* A random number in [lo, hi], rounded to a multiple of 1/4 in half of the calls. */
static inline double lattice(dice *d, double lo, double hi)
{
    const double x = roll(d, lo, hi);
    return pick(d, 2) ? round(4 * x) / 4 : x;
}

/* A random rotation matrix, row-major. */
static inline void rotation(dice *d, double r[9])
{
    double q[4];
    for (int i = 0; i < 4; i++) q[i] = roll(d, -1, 1);
    quaternion_rotation(q, r);
}

/* y = r x; y may be x. */
static inline void rotate(const double r[9], const double x[3], double y[3])
{
    double t[3];
    for (int a = 0; a < 3; a++) t[a] = r[3 * a] * x[0] + r[3 * a + 1] * x[1] + r[3 * a + 2] * x[2];
    memcpy(y, t, sizeof t);
}

static inline void mesh_rotate(sdm_mesh *m, const double r[9])
{
    for (size_t v = 0; v < m->n_vert; v++) rotate(r, &m->vert[3 * v], &m->vert[3 * v]);
}

static inline void mesh_scale(sdm_mesh *m, double s)
{
    for (size_t i = 0; i < 3 * m->n_vert; i++) m->vert[i] *= s;
}

static inline void mesh_move(sdm_mesh *m, const double by[3])
{
    for (size_t i = 0; i < 3 * m->n_vert; i++) m->vert[i] += by[i % 3];
}

/* Puts the triangles into random order, each starting at a random vertex. */
static inline void mesh_shuffle(sdm_mesh *m, dice *d)
{
    for (size_t t = m->n_tri; t-- > 0;) {
        const size_t o = pick(d, t + 1), turn = pick(d, 3);
        uint32_t a[3], b[3];
        memcpy(a, &m->tri[3 * t], sizeof a);
        memcpy(b, &m->tri[3 * o], sizeof b);
        memcpy(&m->tri[3 * o], a, sizeof a);
        for (size_t k = 0; k < 3; k++) m->tri[3 * t + k] = b[(k + turn) % 3];
    }
}

static inline void random_box(sdm_mesh *m, dice *d)
{
    double lo[3], hi[3];
    for (int a = 0; a < 3; a++) {
        lo[a] = lattice(d, -1, 0);
        hi[a] = lo[a] + (pick(d, 3) ? fmax(0.25, lattice(d, 0, 1)) : power_of_ten(d, -9, 1));
    }
    mesh_box(m, lo, hi);
}

static inline void random_tetrahedron(sdm_mesh *m, dice *d)
{
    static const uint8_t face[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
    mesh_make(m, 4, 4);
    for (size_t v = 0; v < 4; v++)
        mesh_vertex(m, v, roll(d, -1, 1), roll(d, -1, 1), roll(d, -1, 1));
    for (size_t t = 0; t < 4; t++) mesh_triangle(m, t, face[t][0], face[t][1], face[t][2]);
}

/* A star-shaped solid: a sphere whose radius varies from vertex to vertex, with spikes and dents
 * but no self-intersections. */
static inline void random_star(sdm_mesh *m, dice *d)
{
    const double zero[3] = {0, 0, 0}, least = pick(d, 3) ? 0.5 : power_of_ten(d, -6, -1);
    mesh_sphere(m, zero, 1, 3 + pick(d, 4));
    for (size_t v = 0; v < m->n_vert; v++) {
        const double r = roll(d, least, 1.5);
        for (size_t a = 0; a < 3; a++) m->vert[3 * v + a] *= r;
    }
}

/* Convex hull of a few random points: tries every triple of points as a face. */
static inline void random_hull(sdm_mesh *m, dice *d)
{
    const size_t n = 4 + pick(d, 9);
    mesh_make(m, n, 2 * n - 4);
    for (size_t i = 0; i < 3 * n; i++) m->vert[i] = roll(d, -1, 1);
    size_t count = 0;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = i + 1; j < n; j++) {
            for (size_t k = i + 1; k < n; k++) {
                const double *a = &m->vert[3 * i], *b = &m->vert[3 * j], *c = &m->vert[3 * k];
                bool outer = k != j;
                for (size_t o = 0; o < n && outer; o++) {
                    const double *p = &m->vert[3 * o];
                    if (o == i || o == j || o == k) continue;
                    double r[3][3];
                    for (int e = 0; e < 3; e++) {
                        r[0][e] = b[e] - a[e];
                        r[1][e] = c[e] - a[e];
                        r[2][e] = p[e] - a[e];
                    }
                    outer = r[2][0] * (r[0][1] * r[1][2] - r[0][2] * r[1][1]) +
                                r[2][1] * (r[0][2] * r[1][0] - r[0][0] * r[1][2]) +
                                r[2][2] * (r[0][0] * r[1][1] - r[0][1] * r[1][0]) <
                            0;
                }
                if (outer && count < m->n_tri) mesh_triangle(m, count++, i, j, k);
            }
        }
    }
    m->n_tri = count;
}

/* Torus with radius `big` of its circle and `small` of its tube; for small > big a spindle torus,
 * which overlaps itself. */
static inline void make_torus(sdm_mesh *m, double big, double small, size_t nu, size_t nv)
{
    const double pi = 3.14159265358979323846;
    mesh_make(m, nu * nv, 2 * nu * nv);
    for (size_t i = 0; i < nu; i++) {
        for (size_t j = 0; j < nv; j++) {
            const double u = 2 * pi * (double)i / (double)nu, v = 2 * pi * (double)j / (double)nv;
            const double r = big + small * cos(v);
            mesh_vertex(m, i * nv + j, r * cos(u), r * sin(u), small * sin(v));
            const size_t p = i * nv + j, q = (i + 1) % nu * nv + j, r0 = i * nv + (j + 1) % nv,
                         r1 = (i + 1) % nu * nv + (j + 1) % nv;
            mesh_triangle(m, 2 * p, p, q, r1);
            mesh_triangle(m, 2 * p + 1, p, r1, r0);
        }
    }
}

static inline void random_torus(sdm_mesh *m, dice *d)
{
    const size_t nu = 3 + pick(d, 8), nv = 3 + pick(d, 5);
    make_torus(m, 1, roll(d, 0.05, 0.95), nu, nv);
}

/* Extruded star polygon: n / 2 fins, joined at a waist that may be extremely narrow. */
static inline void random_prism(sdm_mesh *m, dice *d)
{
    const size_t n = 3 + pick(d, 12);
    const double pi = 3.14159265358979323846, height = pick(d, 2) ? 1 : power_of_ten(d, -6, 1);
    const double waist = pick(d, 2) ? 0.3 : power_of_ten(d, -9, -1);
    mesh_make(m, 2 * n + 2, 4 * n);
    for (size_t i = 0; i < n; i++) {
        const double a = 2 * pi * (double)i / (double)n, r = i % 2 ? waist : roll(d, 0.5, 2);
        mesh_vertex(m, 2 * i, r * cos(a), r * sin(a), 0);
        mesh_vertex(m, 2 * i + 1, r * cos(a), r * sin(a), height);
        const size_t k = (i + 1) % n;
        mesh_triangle(m, 4 * i, 2 * n, 2 * k, 2 * i);
        mesh_triangle(m, 4 * i + 1, 2 * n + 1, 2 * i + 1, 2 * k + 1);
        mesh_triangle(m, 4 * i + 2, 2 * i, 2 * k, 2 * k + 1);
        mesh_triangle(m, 4 * i + 3, 2 * i, 2 * k + 1, 2 * i + 1);
    }
    mesh_vertex(m, 2 * n, 0, 0, 0);
    mesh_vertex(m, 2 * n + 1, 0, 0, height);
}

/* A wedge with a thickness from 1e-12 to 1. */
static inline void random_wedge(sdm_mesh *m, dice *d)
{
    static const uint8_t face[8][3] = {{0, 2, 1}, {3, 4, 5}, {0, 1, 4}, {0, 4, 3},
                                       {1, 2, 5}, {1, 5, 4}, {2, 0, 3}, {2, 3, 5}};
    const double thick = power_of_ten(d, -12, 0), height = lattice(d, 0.25, 1);
    mesh_make(m, 6, 8);
    for (size_t i = 0; i < 2; i++) {
        mesh_vertex(m, 3 * i, 0, 0, i ? height : 0);
        mesh_vertex(m, 3 * i + 1, 1, 0, i ? height : 0);
        mesh_vertex(m, 3 * i + 2, 1, thick, i ? height : 0);
    }
    for (size_t t = 0; t < 8; t++) mesh_triangle(m, t, face[t][0], face[t][1], face[t][2]);
}

/* Two boxes separated by a narrow gap; the first one may be as thin as the gap. */
static inline void random_gap(sdm_mesh *m, dice *d)
{
    const double gap = power_of_ten(d, -12, -1), lo[3] = {0, 0, 0},
                 hi[3] = {pick(d, 2) ? 1 : gap, 1, 1};
    const double from[3] = {hi[0] + gap, pick(d, 2) ? 0 : 0.25, 0},
                 to[3] = {from[0] + 1, from[1] + 1, 0.75};
    sdm_mesh part = {0};
    mesh_box(m, lo, hi);
    mesh_box(&part, from, to);
    mesh_append(m, &part);
    sdm_mesh_dispose(&part);
}

/* A solid of a random kind, oriented outwards. */
static inline void random_solid(sdm_mesh *m, dice *d)
{
    static void (*const make[])(sdm_mesh *, dice *) = {
        random_box,   random_tetrahedron, random_star, random_hull,
        random_torus, random_prism,       random_wedge};
    make[pick(d, sizeof make / sizeof *make)](m, d);
    double volume = 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const double *a = &m->vert[3 * (size_t)m->tri[3 * t]],
                     *b = &m->vert[3 * (size_t)m->tri[3 * t + 1]],
                     *c = &m->vert[3 * (size_t)m->tri[3 * t + 2]];
        volume += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                  a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    if (volume < 0) mesh_flip(m);
}

/* Nested concentric spheres, alternately a solid and a cavity, two to four in all. */
static inline void random_cavity(sdm_mesh *m, dice *d)
{
    const double zero[3] = {0, 0, 0};
    const size_t n = 3 + pick(d, 3), depth = 2 + pick(d, 3);
    sdm_mesh part = {0};
    m->n_vert = m->n_tri = 0;
    for (size_t i = 0; i < depth; i++) {
        mesh_sphere(&part, zero, pow(pick(d, 2) ? 0.4 : 0.45, (double)i), n);
        if (i % 2) mesh_flip(&part);
        mesh_append(m, &part);
    }
    sdm_mesh_dispose(&part);
}

/* A union of unit cubes of a lattice; its mesh consists of all faces between full and empty cells.
 * Has edges with four triangles and vertices where cubes only touch. */
static inline void random_cubes(sdm_mesh *m, dice *d)
{
    enum { N = 3 };
    bool full[N + 2][N + 2][N + 2] = {{{false}}};
    for (int i = 0; i < N * N * N; i++) full[1 + i / 9][1 + i / 3 % 3][1 + i % 3] = pick(d, 5) < 2;
    full[2][2][2] = true;
    mesh_make(m, 64, 0);
    for (size_t v = 0; v < 64; v++)
        mesh_vertex(m, v, (double)(v % 4), (double)(v / 4 % 4), (double)(v / 16));
    const size_t step[3] = {1, 4, 16};
    for (int z = 0; z <= N; z++) {
        for (int y = 0; y <= N; y++) {
            for (int x = 0; x <= N; x++) {
                for (int a = 0; a < 3; a++) {
                    const bool here = full[z + 1][y + 1][x + 1];
                    const bool before = full[z + (a != 2)][y + (a != 1)][x + (a != 0)];
                    if (here == before) continue;
                    const size_t u = step[(a + 1) % 3], v = step[(a + 2) % 3],
                                 p = (size_t)(x + 4 * y + 16 * z);
                    const size_t q[4] = {p, p + (before ? u : v), p + u + v, p + (before ? v : u)},
                                 turn = pick(d, 2);
                    const size_t t = m->n_tri;
                    mesh_make(m, 64, t + 2);
                    mesh_triangle(m, t, q[turn], q[turn + 1], q[turn + 2]);
                    mesh_triangle(m, t + 1, q[turn], q[turn + 2], q[(turn + 3) % 4]);
                }
            }
        }
    }
}

/* Two boxes that touch at a vertex, along an edge, or at a face, fully or in part. */
static inline void random_touch(sdm_mesh *m, dice *d)
{
    double lo[3] = {0, 0, 0}, hi[3] = {1, 1, 1};
    sdm_mesh part = {0};
    mesh_box(m, lo, hi);
    // number of axes along which the boxes touch without overlap
    const size_t shared = 1 + pick(d, 3);
    for (size_t a = 0; a < 3; a++) {
        lo[a] = a < shared ? 1 : 0.25 * (double)pick(d, 4);
        hi[a] = lo[a] + 0.25 * (double)(1 + pick(d, 4));
    }
    mesh_box(&part, lo, hi);
    mesh_append(m, &part);
    sdm_mesh_dispose(&part);
}

/* A solid some of whose triangles are split at points inside, on edges or on vertices: gives
 * slivers, triangles of zero area and repeated vertices. */
static inline void random_slivers(sdm_mesh *m, dice *d)
{
    random_solid(m, d);
    for (int round = 0; round < 12; round++) {
        const size_t t = pick(d, m->n_tri), nt = m->n_tri, nv = m->n_vert;
        const size_t a = m->tri[3 * t], b = m->tri[3 * t + 1], c = m->tri[3 * t + 2];
        double s = roll(d, 0, 1), r = roll(d, 0, 1 - s);
        switch (pick(d, 4)) {
        case 0:
            s = r = 0; // on vertex a
            break;
        case 1:
            r = 0; // on edge a b: the triangle at it has zero area
            break;
        case 2:
            r *= 1e-12; // very close to edge a b
            break;
        default:
            break;
        }
        mesh_make(m, nv + 1, nt + 2);
        double p[3];
        for (size_t k = 0; k < 3; k++)
            p[k] = m->vert[3 * a + k] + s * (m->vert[3 * b + k] - m->vert[3 * a + k]) +
                   r * (m->vert[3 * c + k] - m->vert[3 * a + k]);
        mesh_vertex(m, nv, p[0], p[1], p[2]);
        mesh_triangle(m, t, a, b, nv);
        mesh_triangle(m, nt, b, c, nv);
        mesh_triangle(m, nt + 1, c, a, nv);
    }
}

#endif
