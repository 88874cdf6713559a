/* Random meshes for tests of the exact engine (see random_families[]) and query points at which
 * such engines tend to fail. Mesh number i is the same on all machines. */
#ifndef SDM_TEST_RANDOM_MESHES_H
#define SDM_TEST_RANDOM_MESHES_H

#include "oracle/random_solids.h"

/* ---- solids that overlap ---- */

/* A sphere with randomly displaced vertices. */
static inline void random_shaken(sdm_mesh *m, dice *d)
{
    const double zero[3] = {0, 0, 0}, much = roll(d, 0.1, 0.5);
    mesh_sphere(m, zero, 1, 3 + pick(d, 3));
    for (size_t i = 0; i < 3 * m->n_vert; i++) m->vert[i] += roll(d, -much, much);
}

/* A spindle torus: tube radius >= ring radius, overlaps itself. */
static inline void random_spindle(sdm_mesh *m, dice *d)
{
    const size_t nu = 3 + pick(d, 8), nv = 3 + pick(d, 5);
    make_torus(m, 1, roll(d, 1.0, 2.0), nu, nv);
}

/* Several solids, mostly copies of one, shifted a little, by multiples of 1/4, or not at all. */
static inline void random_copies(sdm_mesh *m, dice *d)
{
    sdm_mesh base = {0}, part = {0};
    random_solid(&base, d);
    m->n_vert = m->n_tri = 0;
    const size_t n = 2 + pick(d, 2);
    for (size_t i = 0; i < n; i++) {
        double by[3];
        if (pick(d, 3) == 0) random_solid(&base, d);
        for (int a = 0; a < 3; a++) by[a] = pick(d, 3) ? lattice(d, -0.75, 0.75) : 0;
        if (sdm_mesh_copy(&base, &part, NULL)) abort();
        mesh_move(&part, by);
        mesh_append(m, &part);
    }
    sdm_mesh_dispose(&base);
    sdm_mesh_dispose(&part);
}

/* ---- closed meshes, parts of whose surface enclose nothing ---- */

/* A solid and one to three copies of it at the same place, some of them reversed. */
static inline void random_layers(sdm_mesh *m, dice *d)
{
    sdm_mesh part = {0};
    random_solid(m, d);
    if (sdm_mesh_copy(m, &part, NULL)) abort();
    for (size_t i = 0, n = 1 + pick(d, 3); i < n; i++) {
        if (pick(d, 2)) mesh_flip(&part);
        mesh_append(m, &part);
    }
    sdm_mesh_dispose(&part);
}

/* A wavy or flat sheet with a front and a back side, alone or across a box. */
static inline void random_sheet(sdm_mesh *m, dice *d)
{
    const size_t n = 2 + pick(d, 3);
    const bool flat = pick(d, 2);
    mesh_make(m, (n + 1) * (n + 1), 4 * n * n);
    for (size_t i = 0; i <= n; i++)
        for (size_t j = 0; j <= n; j++)
            mesh_vertex(m, i * (n + 1) + j, (double)i / (double)n, (double)j / (double)n,
                        flat ? 0.5 : roll(d, 0, 1));
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            const size_t p = i * (n + 1) + j, q = p + n + 1, t = 4 * (i * n + j);
            mesh_triangle(m, t, p, q, q + 1);
            mesh_triangle(m, t + 1, p, q + 1, p + 1);
            mesh_triangle(m, t + 2, p, q + 1, q);
            mesh_triangle(m, t + 3, p, p + 1, q + 1);
        }
    }
    if (pick(d, 3) == 0) return;
    const double lo[3] = {lattice(d, -1, 0), 0, 0}, hi[3] = {0.5, lattice(d, 0.25, 1), 1};
    sdm_mesh part = {0};
    mesh_box(&part, lo, hi);
    mesh_append(m, &part);
    sdm_mesh_dispose(&part);
}

/* Two solids, one of them inside out. */
static inline void random_turned_part(sdm_mesh *m, dice *d)
{
    sdm_mesh part = {0};
    const double by[3] = {lattice(d, 0, 3), lattice(d, 0, 1), 0};
    random_solid(m, d);
    random_solid(&part, d);
    mesh_move(&part, by);
    mesh_flip(&part);
    mesh_append(m, &part);
    sdm_mesh_dispose(&part);
}

/* ---- meshes that are not closed ---- */

/* Random separate triangles: some of zero area, needles, points, or on a lattice. */
static inline void random_soup(sdm_mesh *m, dice *d)
{
    const size_t n = 1 + pick(d, 40);
    mesh_make(m, 3 * n, n);
    for (size_t t = 0; t < n; t++) {
        double v[3][3];
        for (size_t k = 0; k < 9; k++) v[k / 3][k % 3] = roll(d, -1, 1);
        const size_t kind = pick(d, 8);
        for (int a = 0; a < 3; a++) {
            if (kind == 0) v[1][a] = v[0][a];
            if (kind == 1) v[1][a] = v[2][a] = v[0][a];
            if (kind == 2) v[2][a] = v[0][a] + 0.375 * (v[1][a] - v[0][a]);
            if (kind == 3) v[2][a] = v[0][a] + 1e-7 * v[2][a];
            if (kind == 4) v[2][a] = v[0][a] + 0.375 * (v[1][a] - v[0][a]) + 1e-12 * v[2][a];
            for (int k = 0; k < 3 && kind == 5; k++) v[k][a] = floor(4 * v[k][a]) / 4;
        }
        for (size_t k = 0; k < 3; k++) mesh_vertex(m, 3 * t + k, v[k][0], v[k][1], v[k][2]);
        mesh_triangle(m, t, 3 * t, 3 * t + 1, 3 * t + 2);
    }
}

/* A solid with some triangles removed. */
static inline void random_cup(sdm_mesh *m, dice *d)
{
    random_solid(m, d);
    for (size_t i = 0, n = 1 + pick(d, 1 + m->n_tri / 4); i < n && m->n_tri > 1; i++) {
        const size_t t = pick(d, m->n_tri);
        memmove(&m->tri[3 * t], &m->tri[3 * t + 3], 3 * (m->n_tri - t - 1) * sizeof *m->tri);
        m->n_tri--;
    }
}

/* A solid with some triangles reversed. */
static inline void random_mixed(sdm_mesh *m, dice *d)
{
    random_solid(m, d);
    for (size_t i = 0, n = 1 + pick(d, m->n_tri / 2); i < n; i++) {
        const size_t t = pick(d, m->n_tri);
        mesh_triangle(m, t, m->tri[3 * t], m->tri[3 * t + 2], m->tri[3 * t + 1]);
    }
}

static inline void random_moebius(sdm_mesh *m, dice *d)
{
    const size_t n = 5 + pick(d, 30);
    const double width = roll(d, 0.01, 0.4);
    mesh_make(m, 2 * n, 2 * n);
    for (size_t i = 0; i < n; i++) {
        const double a = 2 * 3.14159265358979323846 * (double)i / (double)n;
        for (size_t s = 0; s < 2; s++) {
            const double w = s ? width : -width;
            mesh_vertex(m, 2 * i + s, (1 + w * cos(a / 2)) * cos(a), (1 + w * cos(a / 2)) * sin(a),
                        w * sin(a / 2));
        }
        const bool last = i + 1 == n;
        const size_t p = 2 * i, q = last ? 1 : p + 2, r = last ? 0 : p + 3;
        mesh_triangle(m, 2 * i, p, q, p + 1);
        mesh_triangle(m, 2 * i + 1, q, r, p + 1);
    }
}

typedef enum surface_kind {
    SURFACE_BOUNDARY, /* closed, all of it bounds the solid */
    SURFACE_OVERLAP,  /* closed, some of it lies inside the solid */
    SURFACE_CANCELS,  /* closed, some of it has the outside on both sides */
    SURFACE_OPEN
} surface_kind;

typedef struct random_family {
    const char *name;
    void (*make)(sdm_mesh *m, dice *d);
    surface_kind kind;
} random_family;

static const random_family random_families[] = {
    {"box", random_box, SURFACE_BOUNDARY},
    {"tetrahedron", random_tetrahedron, SURFACE_BOUNDARY},
    {"star", random_star, SURFACE_BOUNDARY},
    {"hull", random_hull, SURFACE_BOUNDARY},
    {"torus", random_torus, SURFACE_BOUNDARY},
    {"prism", random_prism, SURFACE_BOUNDARY},
    {"wedge", random_wedge, SURFACE_BOUNDARY},
    {"gap", random_gap, SURFACE_BOUNDARY},
    {"cavity", random_cavity, SURFACE_BOUNDARY},
    {"cubes", random_cubes, SURFACE_BOUNDARY},
    {"slivers", random_slivers, SURFACE_BOUNDARY},
    {"touch", random_touch, SURFACE_OVERLAP},
    {"spindle", random_spindle, SURFACE_OVERLAP},
    {"copies", random_copies, SURFACE_OVERLAP},
    {"shaken", random_shaken,
     SURFACE_CANCELS}, // loops of the surface may have a negative winding number
    {"layers", random_layers, SURFACE_CANCELS},
    {"sheet", random_sheet, SURFACE_CANCELS},
    {"turned part", random_turned_part, SURFACE_CANCELS},
    {"soup", random_soup, SURFACE_OPEN},
    {"cup", random_cup, SURFACE_OPEN},
    {"mixed", random_mixed, SURFACE_OPEN},
    {"moebius", random_moebius, SURFACE_OPEN},
};
enum { RANDOM_FAMILIES = sizeof random_families / sizeof *random_families };

/* Makes mesh `number`: of family number % RANDOM_FAMILIES, possibly rotated, shifted and scaled,
 * with triangles in random order. Returns its family. */
static inline const random_family *random_mesh(sdm_mesh *m, uint64_t seed, uint64_t number)
{
    const random_family *f = &random_families[number % RANDOM_FAMILIES];
    dice d = {seed, number, 0};
    double r[9];
    f->make(m, &d);
    const size_t motion = pick(&d, 4);
    if (motion & 1) {
        rotation(&d, r);
        mesh_rotate(m, r);
    }
    if (motion & 2) {
        const double by[3] = {roll(&d, -2, 2), roll(&d, -2, 2), roll(&d, -2, 2)};
        mesh_move(m, by);
        mesh_scale(m, power_of_ten(&d, -3, 3));
    }
    mesh_shuffle(m, &d);
    return f;
}

/* Bounding box of all vertices that triangles use; returns their largest abs(coordinate). */
static inline double mesh_bounds(const sdm_mesh *m, double lo[3], double hi[3])
{
    double largest = 0;
    for (int a = 0; a < 3; a++) {
        lo[a] = INFINITY;
        hi[a] = -INFINITY;
    }
    for (size_t i = 0; i < 3 * m->n_tri; i++) {
        for (size_t a = 0; a < 3; a++) {
            const double x = m->vert[3 * (size_t)m->tri[i] + a];
            lo[a] = fmin(lo[a], x);
            hi[a] = fmax(hi[a], x);
            largest = fmax(largest, fabs(x));
        }
    }
    return largest;
}

/* A query point at which engines tend to fail. A point on a vertex, an edge, a face, or on their
 * lines and planes is shifted: not at all, a little, or along one axis or two (so that
 * axis-parallel rays hit needles, edges and vertices). Or: coordinates taken from several vertices,
 * anywhere near the mesh, or far away. */
static inline void random_point(const sdm_mesh *m, dice *d, double x[3])
{
    double lo[3], hi[3], size = 0;
    (void)mesh_bounds(m, lo, hi);
    for (int a = 0; a < 3; a++) size = fmax(size, hi[a] - lo[a]);
    const size_t t = pick(d, m->n_tri), axis = pick(d, 3);
    const double *v[3];
    for (size_t k = 0; k < 3; k++) v[k] = &m->vert[3 * (size_t)m->tri[3 * t + k]];
    // barycentric coordinates; here a point of the face
    double s = roll(d, 0, 1), r = roll(d, 0, 1 - s);
    switch (pick(d, 8)) {
    case 0:
        s = r = 0;
        break;
    case 1:
        r = 0;
        break;
    case 2:
        s = 0.5;
        r = pick(d, 2) ? 0.5 : 0;
        break;
    case 3:
        s = roll(d, -2, 3);
        r = 0;
        break;
    case 4:
        s = roll(d, -2, 3);
        r = roll(d, -2, 3);
        break;
    default:
        break;
    }
    for (int a = 0; a < 3; a++) x[a] = v[0][a] + s * (v[1][a] - v[0][a]) + r * (v[2][a] - v[0][a]);
    const double off = power_of_ten(d, -15, -1) * size;
    const size_t move = pick(d, 10);
    for (size_t a = 0; a < 3; a++) {
        if (move < 2) x[a] += roll(d, -off, off);
        if (move == 2) x[a] += a == axis ? off : 0;
        if (move == 3) x[a] += a == axis ? roll(d, -size, size) : 0;
        if (move == 4) x[a] += a != axis ? roll(d, -size, size) : 0;
        if (move == 5) x[a] = m->vert[3 * (size_t)m->tri[pick(d, 3 * m->n_tri)] + a];
        if (move == 6) x[a] = roll(d, lo[a] - 0.3 * size, hi[a] + 0.3 * size);
        if (move == 7) x[a] = 1000 * roll(d, -size, size);
    }
}

#endif
