/* Small template networks from bodies with closed-form distances, and their maps by the definition
 * in sdm/internal/template.h, in double arithmetic. Include cmocka.h first. */
#ifndef SDM_TEST_TEMPLATE_TOY_H
#define SDM_TEST_TEMPLATE_TOY_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/model_threads.h"
#include "sdm/internal/template.h"
#include "sdm/memory.h"

enum { P = 2, PARTS_MAX = 8, NUMBERS_MAX = 64, MODES = 3 };

/* d0 of a part. The templates interpolate planes and quadrics without an error. A quadric is no
   distance, but has the zero surface of a sphere. */
typedef enum body_kind { PLANE, QUADRIC, CAPSULE } body_kind;

typedef struct body {
    body_kind kind;
    double a[3], b[3], r; /* PLANE: point, normal; QUADRIC: centre, radius; CAPSULE: ends, radius */
} body;

/* g = constant + slope . x + square . x^2 of the scaled parameters x */
typedef struct number {
    double constant, slope[P], square[P];
} number;

typedef struct toy {
    sdm_model_param params[P];
    sdm_model_info info;
    body bodies[PARTS_MAX];
    sdm_template_part parts[PARTS_MAX];
    number numbers[NUMBERS_MAX];
    sdm_template_spec spec;
} toy;

static inline double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* d0 at y, with its gradient. */
static inline double body_distance(const body *o, const double y[3], double g[3])
{
    double d[3], axis[3], t = 0;
    for (int i = 0; i < 3; i++) d[i] = y[i] - o->a[i], axis[i] = o->b[i] - o->a[i];
    if (o->kind == PLANE) {
        memcpy(g, o->b, 3 * sizeof *g);
        return dot3(d, o->b);
    }
    if (o->kind == CAPSULE) t = fmin(fmax(dot3(d, axis) / dot3(axis, axis), 0), 1);
    for (int i = 0; i < 3; i++) d[i] -= t * axis[i];
    const double length = sqrt(dot3(d, d));
    for (int i = 0; i < 3; i++) g[i] = o->kind == QUADRIC ? d[i] / o->r : d[i] / fmax(length, 1e-9);
    return o->kind == QUADRIC ? (length * length - o->r * o->r) / (2 * o->r) : length - o->r;
}

static inline toy toy_new(const sdm_grid *grid)
{
    toy t = {.info = {.shape = "toy", .n_params = P, .seed = 7, .config = "seed: 7\n"}};
    for (int i = 0; i < P; i++) {
        snprintf(t.params[i].name, sizeof t.params[i].name, "p%d", i);
        t.params[i].min = -1 + 3 * i, t.params[i].max = 2 + 4 * i, t.params[i].def = 2 * i;
    }
    t.info.grid = *grid;
    t.spec = (sdm_template_spec){.degree = 2, .n_terms = sdm_poly_count(P, 2)};
    return t;
}

static inline sdm_lattice lattice(const double centre[3], double half, double spacing)
{
    sdm_lattice l = {.spacing = spacing};
    for (int a = 0; a < 3; a++) {
        l.n[a] = (uint32_t)ceil(2 * half / spacing) + 1 + (uint32_t)a;
        l.origin[a] = centre[a] - 0.5 * spacing * (l.n[a] - 1.0);
    }
    return l;
}

static inline void lattice_point(const sdm_lattice *l, size_t i, double y[3])
{
    const size_t at[3] = {i % l->n[0], i / l->n[0] % l->n[1], i / l->n[0] / l->n[1]};
    for (int a = 0; a < 3; a++) y[a] = l->origin[a] + l->spacing * (double)at[a];
}

static inline float *body_nodes(const body *o, const sdm_lattice *l)
{
    const size_t n = sdm_lattice_count(l);
    float *nodes = NULL;
    assert_int_equal(SDM_ALLOC(&nodes, 4 * n, "toy", NULL), SDM_OK);
    for (size_t i = 0; i < n; i++) {
        double y[3], g[3];
        lattice_point(l, i, y);
        nodes[4 * i] = (float)body_distance(o, y, g);
        for (int a = 0; a < 3; a++) nodes[4 * i + 1 + (size_t)a] = (float)g[a];
    }
    return nodes;
}

/* Adds a part with its lattices; the numbers of its frame are zero. Returns the part. */
static inline sdm_template_part *toy_add(toy *t, const body *o, int parent,
                                         sdm_template_frame frame, const sdm_lattice *near,
                                         const sdm_lattice *far)
{
    const size_t c = t->spec.n_parts++;
    assert_true(c < PARTS_MAX);
    t->bodies[c] = *o;
    t->parts[c] = (sdm_template_part){.parent = parent,
                                      .frame = frame,
                                      .pivot = {0.5, -0.25, 1},
                                      .numbers = t->spec.n_numbers,
                                      .near = *near,
                                      .far = *far,
                                      .near_nodes = body_nodes(o, near),
                                      .far_nodes = body_nodes(o, far),
                                      .sag_reach = 1e9}; // all bodies are convex
    t->spec.n_numbers += sdm_template_frame_numbers(frame);
    assert_true(t->spec.n_numbers <= NUMBERS_MAX);
    return &t->parts[c];
}

/* The displacements of three modes: an affine one, a bend, and one with mixed terms. `h`: spacing
   of a lattice whose cubic B-splines are to give the field; 0: the field itself. */
static inline void mode_value(int m, const double y[3], double h, double u[3])
{
    const double square = h * h / 3; // B-splines of the values y^2 - h^2 / 3 are y^2
    static const double affine[9] = {0.1, 0.04, 0, 0.04, -0.06, 0.03, 0, 0.03, 0.08};
    for (int i = 0; i < 3; i++) u[i] = dot3(affine + 3 * i, y);
    if (m == 1) u[0] = 0.02 * (y[2] * y[2] - square), u[1] = u[2] = 0;
    if (m == 2) u[0] = 0, u[1] = 0.02 * y[0] * y[2], u[2] = -0.01 * (y[0] * y[0] - square);
}

/* Gives a part n modes, beginning with mode `first`; the amplitudes are zero. */
static inline void toy_warp(toy *t, size_t c, int first, size_t n, const sdm_lattice *l)
{
    sdm_template_part *p = &t->parts[c];
    const size_t nodes = sdm_lattice_count(l);
    float *modes = NULL;
    assert_int_equal(SDM_ALLOC(&modes, 3 * n * nodes, "toy", NULL), SDM_OK);
    for (size_t m = 0; m < n; m++)
        for (size_t i = 0; i < nodes; i++) {
            double y[3], u[3];
            lattice_point(l, i, y);
            mode_value(first + (int)m, y, l->spacing, u);
            for (size_t a = 0; a < 3; a++) modes[3 * (m * nodes + i) + a] = (float)u[a];
        }
    p->n_modes = n;
    p->amplitudes = t->spec.n_numbers;
    p->warp = *l;
    p->modes = modes;
    t->spec.n_numbers += n;
    assert_true(t->spec.n_numbers <= NUMBERS_MAX);
}

/* *bytes = the model file. */
static inline sdm_status toy_build(toy *t, uint8_t **bytes, size_t *size, sdm_error *err)
{
    const size_t terms = t->spec.n_terms;
    uint8_t exponents[6 * P];
    double functions[NUMBERS_MAX * 6] = {0};
    assert_int_equal(terms, 6);
    sdm_poly_table(P, 2, exponents);
    for (size_t i = 0; i < t->spec.n_numbers; i++) {
        const number *n = &t->numbers[i];
        double *f = functions + i * terms;
        f[0] = n->constant + (n->square[0] + n->square[1]) / 3;
        for (size_t e = 1; e < terms; e++)
            for (int k = 0; k < P; k++) {
                if (exponents[e * P + (size_t)k] == 1 && exponents[e * P + (size_t)!k] == 0)
                    f[e] = n->slope[k] / sqrt(3);
                if (exponents[e * P + (size_t)k] == 2) f[e] = n->square[k] * 2 / (3 * sqrt(5));
            }
    }
    t->info.params = t->params;
    t->spec.info = &t->info;
    t->spec.functions = functions;
    t->spec.parts = t->parts;
    return sdm_template_build(&t->spec, bytes, size, err);
}

static inline sdm_model *toy_open(toy *t)
{
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e = {0};
    if (toy_build(t, &bytes, &size, &e)) fail_msg("%s", e.text);
    if (sdm_model_open_memory("toy", bytes, size, &m, &e)) fail_msg("%s", e.text);
    sdm_free(bytes);
    return m;
}

static inline void toy_dispose(toy *t)
{
    for (size_t c = 0; c < t->spec.n_parts; c++) {
        sdm_free((void *)t->parts[c].near_nodes);
        sdm_free((void *)t->parts[c].far_nodes);
        sdm_free((void *)t->parts[c].modes);
    }
}

/* New map of a model, to be freed with sdm_free(). */
static inline float *toy_map(const sdm_model *m, const double *p, int n_threads)
{
    float *map = NULL;
    void *scratch = NULL;
    assert_int_equal(SDM_ALLOC(&map, sdm_grid_count(&sdm_model_get_info(m)->grid), "map", NULL),
                     SDM_OK);
    assert_int_equal(
        sdm_alloc(&scratch, sdm_model_scratch_bytes_threads(m, 1, n_threads), 1, "scratch", NULL),
        SDM_OK);
    memset(scratch, 0xa5, sdm_model_scratch_bytes_threads(m, 1, n_threads));
    sdm_model_forward_threads(m, p, 1, map, scratch, n_threads);
    sdm_free(scratch);
    return map;
}

/* The definition. */

static inline double toy_number(const toy *t, const double *p, size_t i)
{
    const number *n = &t->numbers[i];
    double g = n->constant;
    for (int k = 0; k < P; k++) {
        const double x = 2 * (p[k] - t->params[k].min) / (t->params[k].max - t->params[k].min) - 1;
        g += n->slope[k] * x + n->square[k] * x * x;
    }
    return g;
}

/* x := the relative frame of part c of x, and its inverse. */
static inline void rotate(const double w[3], double sign, double x[3])
{
    const double angle = sqrt(dot3(w, w));
    if (angle == 0) return;
    const double k[3] = {w[0] / angle, w[1] / angle, w[2] / angle},
                 cross[3] = {k[1] * x[2] - k[2] * x[1], k[2] * x[0] - k[0] * x[2],
                             k[0] * x[1] - k[1] * x[0]},
                 c = cos(angle), s = sign * sin(angle), along = dot3(k, x) * (1 - c);
    for (int i = 0; i < 3; i++) x[i] = c * x[i] + s * cross[i] + along * k[i];
}

// solves the symmetric system (I + S) y = x in place, by Jacobi's iteration
static inline void unstretch(const double s[6], double x[3])
{
    double y[3] = {x[0], x[1], x[2]};
    for (int n = 0; n < 400; n++) {
        const double next[3] = {x[0] - (s[0] * y[0] + s[5] * y[1] + s[4] * y[2]),
                                x[1] - (s[5] * y[0] + s[1] * y[1] + s[3] * y[2]),
                                x[2] - (s[4] * y[0] + s[3] * y[1] + s[2] * y[2])};
        memcpy(y, next, sizeof y);
    }
    memcpy(x, y, sizeof y);
}

/* y := the point of the template of part c that is carried to x. */
static inline void toy_carry_back(const toy *t, const double *p, size_t c, const double x[3],
                                  double y[3])
{
    const sdm_template_part *part = &t->parts[c];
    double g[12];
    if (part->parent >= 0)
        toy_carry_back(t, p, (size_t)part->parent, x, y);
    else
        memcpy(y, x, 3 * sizeof *y);
    for (size_t i = 0; i < sdm_template_frame_numbers(part->frame); i++)
        g[i] = toy_number(t, p, part->numbers + i);
    if (part->frame != SDM_FRAME_NONE) {
        for (int i = 0; i < 3; i++) y[i] -= part->pivot[i] + g[3 + i];
        rotate(g, -1, y);
        if (part->frame == SDM_FRAME_AFFINE) unstretch(g + 6, y);
        for (int i = 0; i < 3; i++) y[i] += part->pivot[i];
    }
}

/* The same with the warp of part c, whose modes begin with mode `first`. */
static inline void toy_unwarp(const toy *t, const double *p, size_t c, int first, double y[3])
{
    const sdm_template_part *part = &t->parts[c];
    const double q[3] = {y[0], y[1], y[2]};
    for (int n = 0; n < 100 && part->n_modes; n++) {
        double sum[3] = {0};
        for (size_t m = 0; m < part->n_modes; m++) {
            double u[3];
            mode_value(first + (int)m, y, 0, u);
            for (int i = 0; i < 3; i++) sum[i] += toy_number(t, p, part->amplitudes + m) * u[i];
        }
        for (int i = 0; i < 3; i++) y[i] = q[i] - sum[i];
    }
}

/* The distance of part c at x: d0 divided to first order by the length of its gradient. */
static inline double toy_distance(const toy *t, const double *p, size_t c, int first,
                                  const double x[3])
{
    const double step = 1e-4, e = 1e-3;
    double y[3], g[3], trace = 0, by_x = 0;
    toy_carry_back(t, p, c, x, y);
    toy_unwarp(t, p, c, first, y);
    const double f = body_distance(&t->bodies[c], y, g);
    for (int a = 0; a < 3; a++) {
        double low[3], high[3], d[3], at[3] = {x[0], x[1], x[2]};
        at[a] = x[a] + step;
        toy_carry_back(t, p, c, at, high);
        toy_unwarp(t, p, c, first, high);
        at[a] = x[a] - step;
        toy_carry_back(t, p, c, at, low);
        toy_unwarp(t, p, c, first, low);
        for (int i = 0; i < 3; i++) d[i] = (high[i] - low[i]) / (2 * step);
        trace += dot3(d, d);
        by_x += dot3(g, d) * dot3(g, d);
    }
    return f * sqrt((dot3(g, g) + e) / (by_x + e * trace / 3));
}

static inline void voxel_world(const sdm_grid *g, size_t v, double x[3])
{
    const size_t nx = (size_t)g->n[0], ny = (size_t)g->n[1];
    const double index[3] = {(double)(v % nx), (double)(v / nx % ny), (double)(v / nx / ny)};
    for (int i = 0; i < 3; i++) {
        x[i] = g->origin[i];
        for (int a = 0; a < 3; a++) x[i] += g->dir[3 * i + a] * g->spacing[a] * index[a];
    }
}

/* The map by the definition at voxel v. */
static inline double toy_reference(const toy *t, const double *p, int first, size_t v)
{
    double x[3], least = INFINITY;
    voxel_world(&t->info.grid, v, x);
    for (size_t c = 0; c < t->spec.n_parts; c++)
        least = fmin(least, toy_distance(t, p, c, first, x));
    return least;
}

/* Grids about the origin: sizes that no block and no step divides, anisotropic voxels, rotated
   axes, a reflection, a single voxel. */
enum { GRIDS = 5 };
static inline sdm_grid toy_grid(int which)
{
    static const int64_t n[GRIDS][3] = {
        {24, 16, 16}, {21, 13, 9}, {17, 10, 11}, {9, 1, 26}, {1, 1, 1}};
    static const double spacing[GRIDS][3] = {
        {0.5, 0.5, 0.5}, {0.5, 0.7, 0.9}, {0.6, 0.5, 0.5}, {0.5, 0.5, 0.3}, {0.5, 0.5, 0.5}};
    sdm_grid g = sdm_grid_centred(n[which], 0.5, (const double[]){0.3, -0.2, 0.1});
    const double c = cos(0.5), s = sin(0.5), turned[9] = {c, -s, 0, s, c, 0, 0, 0, 1},
                 mirrored[9] = {0, 0, 1, 1, 0, 0, 0, -1, 0};
    if (which == 2) memcpy(g.dir, turned, sizeof turned);
    if (which == 3) memcpy(g.dir, mirrored, sizeof mirrored);
    for (int a = 0; a < 3; a++) {
        g.spacing[a] = spacing[which][a];
        g.origin[a] = 0;
    }
    double middle[3], half[3];
    for (int a = 0; a < 3; a++) half[a] = 0.5 * ((double)g.n[a] - 1);
    sdm_grid_world(&g, half, middle);
    for (int a = 0; a < 3; a++) g.origin[a] = 0.1 * a - middle[a];
    return g;
}

#endif
