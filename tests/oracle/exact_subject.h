/* A random mesh with its exact engine ("subject"), and what tests of the engine need: expected
 * signs, tolerances, maps, random grids. Include after cmocka.h. */
#ifndef SDM_TEST_EXACT_SUBJECT_H
#define SDM_TEST_EXACT_SUBJECT_H

#include <float.h>
#include <stdlib.h>

#include "oracle/long_double.h"
#include "oracle/random_meshes.h"
#include "sdm/exact.h"

enum { SUBJECT_SEED = 2026 };

/* Largest error allowed for a distance, in units of rounding_at(). */
static const double bound = 16;

/* Signs of open meshes come from rounded sums of angles: they are not checked nearer to the surface
 * than this fraction of its size. */
static const double open_margin = 1e-8;

typedef struct subject {
    const random_family *family;
    uint64_t number;
    // solid: the mesh with all parts reversed that the engine reports as reversed
    sdm_mesh mesh, solid;
    double largest, size; // largest abs(coordinate), longest edge of the bounding box
    sdm_exact *engine;
    const sdm_exact_report *report;
    dice dice;
} subject;

#define CHECK(condition, s, x, ...)                                                                \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            print_error("mesh %u, %s, at (%.17g, %.17g, %.17g): ", (unsigned)(s)->number,          \
                        (s)->family->name, (x)[0], (x)[1], (x)[2]);                                \
            fail_msg(__VA_ARGS__);                                                                 \
        }                                                                                          \
    } while (0)

static inline sdm_exact *engine_of(const subject *s, const sdm_mesh *m, const sdm_exact_opts *opts)
{
    sdm_exact *e = NULL;
    sdm_error err = {0};
    if (sdm_exact_create(m, opts, &e, &err))
        fail_msg("mesh %u, %s: %s", (unsigned)s->number, s->family->name, err.text);
    return e;
}

/* Reverses all connected parts with a negative volume; returns their number. */
static inline size_t turn_parts(sdm_mesh *m)
{
    uint32_t *part = malloc(m->n_vert * sizeof *part);
    if (!part) abort();
    for (size_t v = 0; v < m->n_vert; v++) part[v] = (uint32_t)v;
    for (bool changed = true; changed;) {
        changed = false;
        for (size_t i = 0; i < 3 * m->n_tri; i++) {
            uint32_t *here = &part[m->tri[i]], *next = &part[m->tri[i / 3 * 3 + (i + 1) % 3]];
            changed = changed || *here != *next;
            *here = *next = *here < *next ? *here : *next;
        }
    }
    size_t n = 0;
    for (size_t v = 0; v < m->n_vert; v++) {
        real volume = 0;
        const point o = point_of(&m->vert[3 * v]);
        for (size_t t = 0; t < m->n_tri; t++)
            if (part[m->tri[3 * t]] == v)
                volume +=
                    dot(minus(corner_of(m, 3 * t), o), cross(minus(corner_of(m, 3 * t + 1), o),
                                                             minus(corner_of(m, 3 * t + 2), o)));
        if (!(volume < 0)) continue;
        n++;
        for (size_t t = 0; t < m->n_tri; t++)
            if (part[m->tri[3 * t]] == v)
                mesh_triangle(m, t, m->tri[3 * t], m->tri[3 * t + 2], m->tri[3 * t + 1]);
    }
    free(part);
    return n;
}

/* Makes mesh `number` with its engine; free with subject_dispose(). */
static inline void subject_make(subject *s, uint64_t number, const sdm_exact_opts *opts)
{
    double lo[3], hi[3];
    *s = (subject){.number = number, .dice = {SUBJECT_SEED + 1, number, 0}};
    s->family = random_mesh(&s->mesh, SUBJECT_SEED, number);
    s->largest = mesh_bounds(&s->mesh, lo, hi);
    for (int a = 0; a < 3; a++) s->size = fmax(s->size, hi[a] - lo[a]);
    s->engine = engine_of(s, &s->mesh, opts);
    s->report = sdm_exact_get_report(s->engine);
    if (sdm_mesh_copy(&s->mesh, &s->solid, NULL)) abort();
    if (s->report->turned) mesh_flip(&s->solid);
    if (s->report->parts_turned) assert_int_equal(turn_parts(&s->solid), s->report->parts_turned);
}

static inline void subject_dispose(subject *s)
{
    sdm_exact_free(s->engine);
    sdm_mesh_dispose(&s->mesh);
    sdm_mesh_dispose(&s->solid);
}

/* Unit of rounding errors at x: DBL_EPSILON times the largest abs(coordinate) of the mesh and of x.
 */
static inline double rounding_at(const subject *s, const double x[3])
{
    double largest = s->largest;
    for (int a = 0; a < 3; a++) largest = fmax(largest, fabs(x[a]));
    return DBL_EPSILON * largest;
}

/* Is p inside the solid? Reliable if p is farther from all triangles than rounding. */
static inline bool truly_inside(const subject *s, point p)
{
    const real w = brute_winding(&s->solid, p);
    if (!s->report->audit.closed) return w > 0.5L;
    // the winding number of a closed mesh is an integer
    if (!(fabsl(w - roundl(w)) < 1e-3L))
        fail_msg("mesh %u, %s: winding number %.9Lg", (unsigned)s->number, s->family->name, w);
    return lroundl(w) >= 1;
}

/* Position of voxel i of a map values[nz][ny][nx]. */
static inline void voxel(const sdm_grid *g, size_t i, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
    sdm_grid_world(g, index, x);
}

static inline float *map_of(const subject *s, const sdm_exact *e, const sdm_grid *g)
{
    sdm_error err = {0};
    float *v = malloc(sdm_grid_count(g) * sizeof *v);
    if (!v || sdm_exact_map(e, g, v, &err))
        fail_msg("mesh %u, %s: %s", (unsigned)s->number, s->family->name, err.text);
    return v;
}

/* A random grid around or near the mesh, possibly mirrored. *exact = true: all voxel positions are
 * exact in floating point. Otherwise one voxel lies on a vertex of the mesh, and half of these
 * grids are rotated with three different spacings. */
static inline sdm_grid random_grid(subject *s, bool *exact)
{
    dice *d = &s->dice;
    sdm_grid g = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    const size_t kind = pick(d, 3);
    const double *corner = &s->mesh.vert[3 * (size_t)s->mesh.tri[pick(d, 3 * s->mesh.n_tri)]];
    int exponent;
    (void)frexp(s->size, &exponent);
    const double unit = ldexp(1, exponent - 4);
    for (int a = 0; a < 3; a++) {
        g.n[a] = 1 + (int64_t)pick(d, 12);
        g.spacing[a] =
            kind < 2 ? unit * (double)(1 + pick(d, 4)) : s->size * power_of_ten(d, -2, -0.3);
        g.origin[a] = corner[a] - g.spacing[a] * (double)pick(d, (size_t)g.n[a]);
        if (kind == 0) g.origin[a] = unit * round(g.origin[a] / unit);
    }
    *exact = kind == 0;
    if (kind == 2) rotation(d, g.dir);
    const size_t mirror = pick(d, 4);
    for (size_t k = 0; k < 3 && mirror < 3; k++) g.dir[3 * k + mirror] = -g.dir[3 * k + mirror];
    return g;
}

/* Reads the program's arguments [MESHES [FIRST]]: number of meshes (default: *n_meshes) and number
 * of the first one (default: 0). */
static inline void subject_range(int argc, char **argv, uint64_t *n_meshes, uint64_t *first)
{
    if (argc > 1) *n_meshes = strtoull(argv[1], NULL, 10);
    *first = argc > 2 ? strtoull(argv[2], NULL, 10) : 0;
}

#endif
