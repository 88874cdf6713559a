/* Iso-surfaces of maps: marching cubes (Lorensen and Cline 1987) without a table of cases. In every
   cell the crossings of each face are joined by directed segments; the segments chain into loops,
   and the loops become triangles. An ambiguous face is decided by its bilinear saddle (Nielson and
   Hamann 1991), a function of the face alone: both cells at a face draw the same segments in
   opposite directions, which closes the surface. */
#include <float.h>
#include <math.h>

#include "sdm/internal/builder.h"
#include "sdm/internal/heap.h"
#include "sdm/isosurface.h"

#define NO_VERTEX UINT32_MAX

/* A vertex keeps this distance (in voxels) from the voxel centres: values equal to the level would
 * make empty triangles. */
#define LEAST_STEP 1e-4

/* Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2). Edge 4 a + 2 v + u runs along axis a, at u
   along axis a + 1 and v along axis a + 2 (modulo 3); this is the corner it starts from. */
static int edge_start(int edge)
{
    const int a = edge >> 2, u = edge & 1, v = edge >> 1 & 1;
    return u << (a + 1) % 3 | v << (a + 2) % 3;
}

/* The work at a surface: two layers of vertices on the edges along x and y, one on the edges along
 * z between them. */
typedef struct tracer {
    const sdm_grid *g;
    const float *values;
    double level;
    bool mirrored, cut;
    size_t nx, ny, nz;
    uint32_t *edge[2][2]; /* [layer & 1][axis]: [ny][nx] */
    uint32_t *edge_z;     /* [ny][nx] */
    sdm_builder b;
} tracer;

/* A cell on the surface: values minus level at the corners, vertices on the edges, and for each
 * edge the one its loop goes to. */
typedef struct cell {
    double v[8];
    uint32_t vertex[12];
    int next[12];
} cell;

static double value_at(const tracer *t, size_t i, size_t j, size_t k)
{
    return (double)t->values[(k * t->ny + j) * t->nx + i] - t->level;
}

/* The vertex on the edge from (i, j, k) along `axis`, if the level is crossed there. */
static sdm_status add_crossing(tracer *t, const size_t at[3], int axis, uint32_t *vertex,
                               sdm_error *err)
{
    const size_t n[3] = {t->nx, t->ny, t->nz};
    *vertex = NO_VERTEX;
    if (at[axis] + 1 >= n[axis]) return SDM_OK;
    const double a = value_at(t, at[0], at[1], at[2]);
    const double b = value_at(t, at[0] + (axis == 0), at[1] + (axis == 1), at[2] + (axis == 2));
    if ((a < 0) == (b < 0)) return SDM_OK;
    for (int d = 0; d < 3; d++) t->cut = t->cut || (d != axis && (at[d] == 0 || at[d] + 1 == n[d]));
    if (t->nx < 2 || t->ny < 2 || t->nz < 2) return SDM_OK; /* no cell would use it */
    double index[3] = {(double)at[0], (double)at[1], (double)at[2]}, world[3];
    index[axis] += fmin(fmax(a / (a - b), LEAST_STEP), 1 - LEAST_STEP);
    sdm_grid_world(t->g, index, world);
    *vertex = (uint32_t)t->b.n_vert;
    return sdm_builder_vertex(&t->b, world, err);
}

/* Vertices on the edges in layer k, and with `upwards` on those from layer k to the next. */
static sdm_status add_layer(tracer *t, size_t k, bool upwards, sdm_error *err)
{
    for (size_t j = 0; j < t->ny; j++) {
        for (size_t i = 0; i < t->nx; i++) {
            const size_t at[3] = {i, j, k}, slot = j * t->nx + i;
            sdm_status e;
            if (upwards) {
                e = add_crossing(t, at, 2, &t->edge_z[slot], err);
                if (e) return e;
                continue;
            }
            for (int axis = 0; axis < 2; axis++) {
                e = add_crossing(t, at, axis, &t->edge[k & 1][axis][slot], err);
                if (e) return e;
            }
        }
    }
    return SDM_OK;
}

/* Directed segments on the face normal to `axis` at its lower (side 0) or upper end. Going around
   the face counter-clockwise as seen from outside the cell, a segment leads from an edge where the
   walk enters the inside to one where it leaves it. */
static void join_face(cell *c, int axis, int side)
{
    const int a1 = (axis + 1) % 3, a2 = (axis + 2) % 3, base = side << axis, one = 1 << a1,
              two = 1 << a2;
    const int upper[4] = {base, base | one, base | one | two, base | two},
              lower[4] = {upper[0], upper[3], upper[2], upper[1]};
    const int up[4] = {4 * a1 + 2 * side, 4 * a2 + 2 + side, 4 * a1 + 2 * side + 1, 4 * a2 + side};
    const int down[4] = {up[3], up[2], up[1], up[0]};
    const int *corner = side ? upper : lower, *edge = side ? up : down;
    int enter[2], leave[2], n_enter = 0, n_leave = 0;
    for (int s = 0; s < 4; s++) {
        const bool here = c->v[corner[s]] < 0, there = c->v[corner[(s + 1) % 4]] < 0;
        if (!here && there) enter[n_enter++] = edge[s];
        if (here && !there) leave[n_leave++] = edge[s];
    }
    if (n_enter == 1) c->next[enter[0]] = leave[0];
    if (n_enter != 2) return;
    /* four crossings: joined if the saddle is inside; then a segment leads back to the leave
     * before, else to the next one */
    const double even = c->v[corner[0]] * c->v[corner[2]], odd = c->v[corner[1]] * c->v[corner[3]];
    const bool starts_inside = c->v[corner[0]] < 0,
               joined = starts_inside ? even > odd : odd > even;
    for (int i = 0; i < 2; i++) c->next[enter[i]] = leave[(i + (starts_inside != joined)) % 2];
}

/* The two faces an edge lies on, as bits. */
static int edge_faces(int edge)
{
    const int a = edge >> 2;
    return 1 << (2 * ((a + 1) % 3) + (edge & 1)) | 1 << (2 * ((a + 2) % 3) + (edge >> 1 & 1));
}

/* Sum of the squared diagonals of the fan around corner p of a loop, or infinity when a diagonal
   lies on a face of the cell: the cell behind that face could draw the same one. */
static double fan_cost(const tracer *t, const cell *c, const int *loop, int n, int p)
{
    double cost = 0;
    const double *x = t->b.mesh->vert + 3 * (size_t)c->vertex[loop[p]];
    for (int i = 2; i < n - 1; i++) {
        const int q = loop[(p + i) % n];
        if (edge_faces(loop[p]) & edge_faces(q)) return INFINITY;
        const double *y = t->b.mesh->vert + 3 * (size_t)c->vertex[q];
        for (int d = 0; d < 3; d++) cost += (x[d] - y[d]) * (x[d] - y[d]);
    }
    return cost;
}

static sdm_status add_triangle(tracer *t, uint32_t a, uint32_t b, uint32_t c, sdm_error *err)
{
    return t->mirrored ? sdm_builder_triangle(&t->b, a, c, b, err)
                       : sdm_builder_triangle(&t->b, a, b, c, err);
}

/* A fan around the middle of the loop, for the few loops that have no other. */
static sdm_status fill_around_middle(tracer *t, const cell *c, const int *loop, int n,
                                     sdm_error *err)
{
    double middle[3] = {0};
    for (int i = 0; i < n; i++)
        for (int d = 0; d < 3; d++)
            middle[d] += t->b.mesh->vert[3 * (size_t)c->vertex[loop[i]] + (size_t)d] / n;
    const uint32_t v = (uint32_t)t->b.n_vert;
    sdm_status e = sdm_builder_vertex(&t->b, middle, err);
    for (int i = 0; i < n && !e; i++)
        e = add_triangle(t, v, c->vertex[loop[i]], c->vertex[loop[(i + 1) % n]], err);
    return e;
}

static sdm_status fill_loop(tracer *t, const cell *c, const int *loop, int n, sdm_error *err)
{
    int best = 0;
    double least = INFINITY;
    for (int p = 0; p < n; p++) {
        const double cost = fan_cost(t, c, loop, n, p);
        if (!(cost < least)) continue;
        least = cost;
        best = p;
    }
    if (!(least < INFINITY)) return fill_around_middle(t, c, loop, n, err);
    sdm_status e = SDM_OK;
    for (int i = 1; i < n - 1 && !e; i++)
        e = add_triangle(t, c->vertex[loop[best]], c->vertex[loop[(best + i) % n]],
                         c->vertex[loop[(best + i + 1) % n]], err);
    return e;
}

static sdm_status trace_cell(tracer *t, cell *c, sdm_error *err)
{
    for (int e = 0; e < 12; e++) c->next[e] = -1;
    for (int face = 0; face < 6; face++) join_face(c, face >> 1, face & 1);
    for (int start = 0; start < 12; start++) {
        int loop[12], n = 0;
        for (int e = start; c->next[e] >= 0;) {
            loop[n++] = e;
            const int next = c->next[e];
            c->next[e] = -1;
            e = next;
        }
        const sdm_status status = n ? fill_loop(t, c, loop, n, err) : SDM_OK;
        if (status) return status;
    }
    return SDM_OK;
}

/* The vertices on the twelve edges of the cell at (i, j, k). */
static void collect_vertices(const tracer *t, size_t i, size_t j, size_t k, cell *c)
{
    for (int e = 0; e < 12; e++) {
        const int at = edge_start(e), axis = e >> 2;
        const size_t slot = (j + (size_t)(at >> 1 & 1)) * t->nx + i + (size_t)(at & 1),
                     layer = k + (size_t)(at >> 2);
        c->vertex[e] = axis == 2 ? t->edge_z[slot] : t->edge[layer & 1][axis][slot];
    }
}

static sdm_status trace_layer(tracer *t, size_t k, sdm_error *err)
{
    for (size_t j = 0; j + 1 < t->ny; j++) {
        for (size_t i = 0; i + 1 < t->nx; i++) {
            cell c;
            int inside = 0;
            for (size_t n = 0; n < 8; n++) {
                c.v[n] = value_at(t, i + (n & 1), j + (n >> 1 & 1), k + (n >> 2));
                inside += c.v[n] < 0;
            }
            if (inside == 0 || inside == 8) continue;
            collect_vertices(t, i, j, k, &c);
            const sdm_status e = trace_cell(t, &c, err);
            if (e) return e;
        }
    }
    return SDM_OK;
}

static sdm_status trace(tracer *t, sdm_error *err)
{
    sdm_status e = add_layer(t, 0, false, err);
    for (size_t k = 0; k < t->nz && !e; k++) {
        if (k + 1 < t->nz) e = add_layer(t, k + 1, false, err);
        if (!e) e = add_layer(t, k, true, err);
        if (!e && k + 1 < t->nz) e = trace_layer(t, k, err);
    }
    return e ? e : sdm_builder_finish(&t->b, err);
}

static sdm_status check_values(const sdm_grid *g, const float *values, float level, sdm_error *err)
{
    const size_t n = sdm_grid_count(g);
    if (!(fabsf(level) <= FLT_MAX))
        return sdm_fail(err, SDM_E_ARG, "level %g of an iso-surface, need a finite one",
                        (double)level);
    for (size_t i = 0; i < n; i++)
        if (!(fabsf(values[i]) <= FLT_MAX))
            return sdm_fail(err, SDM_E_ARG, "value %g of voxel %zu is not finite: no iso-surface",
                            (double)values[i], i);
    return SDM_OK;
}

sdm_status sdm_isosurface(const sdm_grid *grid, const float *values, float level, sdm_mesh *out,
                          bool *cut, sdm_error *err)
{
    if (!grid || !values || !out) return sdm_fail(err, SDM_E_ARG, "sdm_isosurface: NULL argument");
    sdm_status e = sdm_grid_check(grid, err);
    if (!e) e = check_values(grid, values, level, err);
    if (e) return e;
    out->n_vert = out->n_tri = 0;
    tracer t = {
        .g = grid, .values = values, .level = (double)level, .b = {.path = "", .mesh = out}};
    t.nx = (size_t)grid->n[0];
    t.ny = (size_t)grid->n[1];
    t.nz = (size_t)grid->n[2];
    const double *r = grid->dir;
    t.mirrored = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
                     r[2] * (r[3] * r[7] - r[4] * r[6]) <
                 0;
    uint32_t *layers = NULL;
    const size_t area = t.nx * t.ny;
    size_t five;
    e = sdm_mul(area, 5, &five, err);
    if (!e) e = SDM_ALLOC(&layers, five, "layers of an iso-surface", err);
    if (!e) {
        for (int i = 0; i < 4; i++) t.edge[i >> 1][i & 1] = layers + (size_t)i * area;
        t.edge_z = layers + 4 * area;
        e = trace(&t, err);
    }
    sdm_free(layers);
    if (e) sdm_mesh_dispose(out);
    if (!e && cut) *cut = t.cut;
    return e;
}
