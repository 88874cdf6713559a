/* Iso-surface of a map: marching cubes (Lorensen and Cline 1987) without a table of cases. On each
 * face of a cell (8 neighbouring voxels) directed segments join the points where the level is
 * crossed; the segments of the six faces form closed loops, and the loops become triangles. An
 * ambiguous face is decided by the value of its bilinear interpolant at the saddle (Nielson and
 * Hamann 1991). This depends on the face alone, so both cells at a face draw the same segments in
 * opposite directions, which closes the surface. */
#include <float.h>
#include <math.h>

#include "sdm/internal/builder.h"
#include "sdm/internal/heap.h"
#include "sdm/isosurface.h"

/* Minimum distance of a vertex from a voxel centre, in voxels: voxels exactly at the level would
 * give triangles without area. */
#define STEP_MIN 1e-4

/* Corner c of a cell is at (c & 1, c >> 1 & 1, c >> 2). Edge 4 a + 2 v + u of a cell runs along
 * axis a; it is at u along axis (a + 1) % 3 and at v along axis (a + 2) % 3. Returns the corner at
 * the lower end of the edge. */
static int edge_start(int edge)
{
    const int a = edge >> 2, u = edge & 1, v = edge >> 1 & 1;
    return u << (a + 1) % 3 | v << (a + 2) % 3;
}

/* Bit mask of the two faces of the cell on which an edge lies. */
static int edge_faces(int edge)
{
    const int a = edge >> 2;
    return 1 << (2 * ((a + 1) % 3) + (edge & 1)) | 1 << (2 * ((a + 2) % 3) + (edge >> 1 & 1));
}

/* The closed loops of a cell, each a row of edges: loop after loop in edge[]. */
typedef struct loops {
    bool known;
    int8_t n, size[4]; // a loop has three edges at least
    int8_t edge[12];
} loops;

/* State of the extraction, which goes through the grid layer by layer in z. Vertex indices are kept
 * for the edges along x and y in two layers, and for the edges along z between them. Bits say which
 * voxels are inside: so words of bits find the few edges and cells that the surface meets. */
typedef struct tracer {
    const sdm_grid *g;
    const float *values;
    double level;
    bool mirrored; /* the grid's axes form a left-handed system */
    bool cut;      /* the surface leaves the grid */
    size_t nx, ny, nz;
    size_t words;        /* of the bits of a row of voxels */
    uint64_t *inside[2]; /* [layer & 1]: [ny][words], a bit a voxel: its value is below the level */
    uint32_t *edge[2][2];    /* [layer & 1][axis]: [ny][nx], set where the level is crossed */
    uint32_t *edge_z;        /* [ny][nx] */
    size_t edge_slot[2][12]; /* [k & 1]: where edge_z has the vertex of an edge of cell (0, 0, k) */
    int faces[12];           /* edge_faces() */
    loops found[256];        /* of cells without an ambiguous face: [bits of the corners inside] */
    sdm_builder b;
} tracer;

/* A cell that the surface passes through. */
typedef struct cell {
    double v[8];         /* value minus level at the corners; < 0: inside */
    uint32_t vertex[12]; /* vertex on each edge that the level crosses */
    int next[12];        /* the edge to which the segment from each edge leads; -1: none */
} cell;

static double value_at(const tracer *t, size_t i, size_t j, size_t k)
{
    return (double)t->values[(k * t->ny + j) * t->nx + i] - t->level;
}

/* Sets the bits of the voxels in layer k that are inside. */
static void mark_layer(tracer *t, size_t k)
{
    const float level = (float)t->level;
    for (size_t j = 0; j < t->ny; j++) {
        const float *row = t->values + (k * t->ny + j) * t->nx;
        uint64_t *bits = t->inside[k & 1] + j * t->words;
        for (size_t w = 0; w < t->words; w++) bits[w] = 0;
        for (size_t i = 0; i < t->nx; i++) bits[i / 64] |= (uint64_t)(row[i] < level) << i % 64;
    }
}

/* Bit i of the result: the bit of the voxel with the next larger x after voxel 64 w + i of the row;
 * 0 behind the last voxel. */
static uint64_t next_along_x(const tracer *t, const uint64_t *row, size_t w)
{
    return row[w] >> 1 | (w + 1 < t->words ? row[w + 1] << 63 : 0);
}

/* Bit i of the result: whether voxel 64 w + i is not the last one of its row. */
static uint64_t have_next(const tracer *t, size_t w)
{
    return w + 1 < t->words ? UINT64_MAX : ((uint64_t)1 << (t->nx - 1) % 64) - 1;
}

/* Adds the vertex on the grid edge from voxel `at` along `axis`, on which the level is crossed. */
static sdm_status add_crossing(tracer *t, const size_t at[3], int axis, uint32_t *vertex,
                               sdm_error *err)
{
    const size_t n[3] = {t->nx, t->ny, t->nz};
    // a vertex on the boundary of the grid
    for (int d = 0; d < 3; d++) t->cut = t->cut || (d != axis && (at[d] == 0 || at[d] + 1 == n[d]));
    // a grid with a single layer of voxels has no cells, so the vertex would not be used
    if (t->nx < 2 || t->ny < 2 || t->nz < 2) return SDM_OK;
    const double a = value_at(t, at[0], at[1], at[2]);
    const double b = value_at(t, at[0] + (axis == 0), at[1] + (axis == 1), at[2] + (axis == 2));
    double index[3] = {(double)at[0], (double)at[1], (double)at[2]}, world[3];
    index[axis] += fmin(fmax(a / (a - b), STEP_MIN), 1 - STEP_MIN);
    sdm_grid_world(t->g, index, world);
    *vertex = (uint32_t)t->b.n_vert;
    return sdm_builder_vertex(&t->b, world, err);
}

/* Adds the vertices on the edges from the voxels of word w of row (j, k); crossed[axis]: bits of
 * the edges along an axis on which the level is crossed. */
static sdm_status add_word(tracer *t, size_t j, size_t k, size_t w, const uint64_t crossed[3],
                           sdm_error *err)
{
    for (uint64_t any = crossed[0] | crossed[1] | crossed[2]; any; any &= any - 1) {
        const int bit = __builtin_ctzll(any);
        const size_t i = 64 * w + (size_t)bit, at[3] = {i, j, k}, slot = j * t->nx + i;
        for (int axis = 0; axis < 3; axis++) {
            if (!(crossed[axis] >> bit & 1)) continue;
            uint32_t *vertex = axis == 2 ? &t->edge_z[slot] : &t->edge[k & 1][axis][slot];
            const sdm_status s = add_crossing(t, at, axis, vertex, err);
            if (s) return s;
        }
    }
    return SDM_OK;
}

/* Adds the vertices on the grid edges along x and y in layer k, or with `upwards` those on the
 * edges from layer k to layer k + 1. */
static sdm_status add_layer(tracer *t, size_t k, bool upwards, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t j = 0; j < t->ny && !s; j++) {
        const uint64_t *row = t->inside[k & 1] + j * t->words,
                       *above = t->inside[(k + 1) & 1] + j * t->words;
        for (size_t w = 0; w < t->words && !s; w++) {
            uint64_t crossed[3] = {0};
            if (upwards) {
                crossed[2] = row[w] ^ above[w];
            } else {
                crossed[0] = (row[w] ^ next_along_x(t, row, w)) & have_next(t, w);
                crossed[1] = j + 1 < t->ny ? row[w] ^ row[t->words + w] : 0;
            }
            s = add_word(t, j, k, w, crossed, err);
        }
    }
    return s;
}

/* Draws the directed segments on one face of the cell: the lower (side 0) or upper (side 1) face
 * perpendicular to `axis`. Walk around the face counter-clockwise, seen from outside the cell: each
 * segment leads from an edge on which the walk enters the inside to an edge on which the walk
 * leaves the inside. */
static void join_face(cell *c, int axis, int side)
{
    const int a1 = (axis + 1) % 3, a2 = (axis + 2) % 3, base = side << axis, one = 1 << a1,
              two = 1 << a2;
    // corners and edges in the order of the walk
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
    // Four crossings: the two inside corners are joined if the saddle is inside. If they are
    // joined, each segment leads to the previous leaving edge of the walk, otherwise to the next
    // one.
    const double even = c->v[corner[0]] * c->v[corner[2]], odd = c->v[corner[1]] * c->v[corner[3]];
    const bool starts_inside = c->v[corner[0]] < 0,
               joined = starts_inside ? even > odd : odd > even;
    for (int i = 0; i < 2; i++) c->next[enter[i]] = leave[(i + (starts_inside != joined)) % 2];
}

/* Cost of triangulating loop[n] as a fan around its corner p: the sum of the squared lengths of its
 * diagonals. INFINITY when a diagonal lies on a face of the cell: the neighbouring cell could use
 * the same diagonal, which would then be an edge of four triangles. */
static double fan_cost(const tracer *t, const cell *c, const int8_t *loop, int n, int p)
{
    double cost = 0;
    const double *x = t->b.mesh->vert + 3 * (size_t)c->vertex[loop[p]];
    for (int i = 2; i < n - 1; i++) {
        const int8_t q = loop[(p + i) % n];
        if (t->faces[loop[p]] & t->faces[q]) return INFINITY;
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

/* Triangulates the loop as a fan around its centroid, a new vertex, for the few loops on which
 * every other fan costs INFINITY. */
static sdm_status fill_around_middle(tracer *t, const cell *c, const int8_t *loop, int n,
                                     sdm_error *err)
{
    double middle[3] = {0};
    for (int i = 0; i < n; i++)
        for (int d = 0; d < 3; d++)
            middle[d] += t->b.mesh->vert[3 * (size_t)c->vertex[loop[i]] + (size_t)d] / n;
    const uint32_t v = (uint32_t)t->b.n_vert;
    sdm_status s = sdm_builder_vertex(&t->b, middle, err);
    for (int i = 0; i < n && !s; i++)
        s = add_triangle(t, v, c->vertex[loop[i]], c->vertex[loop[(i + 1) % n]], err);
    return s;
}

/* Triangulates the loop as the cheapest fan. */
static sdm_status fill_loop(tracer *t, const cell *c, const int8_t *loop, int n, sdm_error *err)
{
    if (n == 3)
        return add_triangle(t, c->vertex[loop[0]], c->vertex[loop[1]], c->vertex[loop[2]], err);
    int best = 0;
    double best_cost = INFINITY;
    // corners that are opposite to each other in a loop of four have the same fan
    const int n_fans = n == 4 ? 2 : n;
    for (int p = 0; p < n_fans; p++) {
        const double cost = fan_cost(t, c, loop, n, p);
        if (!(cost < best_cost)) continue;
        best_cost = cost;
        best = p;
    }
    if (!(best_cost < INFINITY)) return fill_around_middle(t, c, loop, n, err);
    sdm_status s = SDM_OK;
    for (int i = 1; i < n - 1 && !s; i++)
        s = add_triangle(t, c->vertex[loop[best]], c->vertex[loop[(best + i) % n]],
                         c->vertex[loop[(best + i + 1) % n]], err);
    return s;
}

/* Finds the loops of a cell from the values at its corners. */
static void find_loops(cell *c, loops *out)
{
    int8_t *edge = out->edge;
    out->n = 0;
    for (int e = 0; e < 12; e++) c->next[e] = -1;
    for (int face = 0; face < 6; face++) join_face(c, face >> 1, face & 1);
    for (int start = 0; start < 12; start++) {
        // follow the loop through this edge, and delete its segments
        int size = 0;
        for (int e = start; c->next[e] >= 0;) {
            *edge++ = (int8_t)e;
            size++;
            const int next = c->next[e];
            c->next[e] = -1;
            e = next;
        }
        if (size) out->size[out->n++] = (int8_t)size;
    }
}

/* Whether a face of the cell has two corners inside that lie across from each other, and no other
 * one; inside: bits of the corners. */
static bool is_ambiguous(int inside)
{
    for (int axis = 0; axis < 3; axis++) {
        const int one = 1 << (axis + 1) % 3, two = 1 << (axis + 2) % 3;
        for (int base = 0; base <= 1 << axis; base += 1 << axis) {
            const int first = (inside >> base & 1) | (inside >> (base | one | two) & 1) << 1,
                      second = (inside >> (base | one) & 1) | (inside >> (base | two) & 1) << 1;
            if ((first == 3 && second == 0) || (first == 0 && second == 3)) return true;
        }
    }
    return false;
}

/* Bits of the cells that the surface passes through: with lower corners in word w of row j, between
 * the layers of the tracer. */
static uint64_t met_cells(const tracer *t, size_t j, size_t w)
{
    uint64_t some = 0, all = UINT64_MAX;
    for (int corner = 0; corner < 4; corner++) {
        const uint64_t *row = t->inside[corner >> 1] + (j + (size_t)(corner & 1)) * t->words;
        const uint64_t here = row[w], next = next_along_x(t, row, w);
        some |= here | next;
        all &= here & next;
    }
    return some & ~all & have_next(t, w);
}

/* The loops of the cell with lower corner (i, j, k); *own: memory for those of an ambiguous cell.
 */
static const loops *loops_of(tracer *t, size_t i, size_t j, size_t k, cell *c, loops *own)
{
    int inside = 0;
    for (size_t n = 0; n < 8; n++) {
        const size_t at = i + (n & 1), row = (j + (n >> 1 & 1)) * t->words;
        inside |= (int)(t->inside[(k + (n >> 2)) & 1][row + at / 64] >> at % 64 & 1) << n;
    }
    loops *found = &t->found[inside];
    if (found->known) return found;
    for (size_t n = 0; n < 8; n++)
        c->v[n] = value_at(t, i + (n & 1), j + (n >> 1 & 1), k + (n >> 2));
    if (is_ambiguous(inside))
        found = own;
    else
        found->known = true;
    find_loops(c, found);
    return found;
}

/* Adds the triangles of the cell with lower corner (i, j, k). */
static sdm_status add_cell(tracer *t, size_t i, size_t j, size_t k, sdm_error *err)
{
    cell c;
    loops own;
    const loops *of = loops_of(t, i, j, k, &c, &own);
    const uint32_t *vertices = t->edge_z + j * t->nx + i;
    const int8_t *edge = of->edge;
    sdm_status s = SDM_OK;
    for (int n = 0; n < of->n && !s; n++) {
        for (int e = 0; e < of->size[n]; e++)
            c.vertex[edge[e]] = vertices[t->edge_slot[k & 1][edge[e]]];
        s = fill_loop(t, &c, edge, of->size[n], err);
        edge += of->size[n];
    }
    return s;
}

/* Adds the triangles of the cells between layers k and k + 1. */
static sdm_status trace_layer(tracer *t, size_t k, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t j = 0; j + 1 < t->ny; j++)
        for (size_t w = 0; w < t->words; w++)
            for (uint64_t met = met_cells(t, j, w); met && !s; met &= met - 1)
                s = add_cell(t, 64 * w + (size_t)__builtin_ctzll(met), j, k, err);
    return s;
}

static sdm_status trace_grid(tracer *t, sdm_error *err)
{
    mark_layer(t, 0);
    sdm_status s = add_layer(t, 0, false, err);
    for (size_t k = 0; k + 1 < t->nz && !s; k++) {
        mark_layer(t, k + 1);
        s = add_layer(t, k + 1, false, err);
        if (!s) s = add_layer(t, k, true, err);
        if (!s) s = trace_layer(t, k, err);
    }
    return s ? s : sdm_builder_finish(&t->b, err);
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

/* Makes the memory of the layers: edge_z and inside[0] are its beginnings. */
static sdm_status make_layers(tracer *t, sdm_error *err)
{
    const size_t area = t->nx * t->ny, bits = t->words * t->ny;
    size_t five;
    sdm_status s = sdm_mul(area, 5, &five, err);
    if (!s) s = SDM_ALLOC(&t->edge_z, five, "layers of an iso-surface", err);
    if (!s) s = SDM_ALLOC(&t->inside[0], 2 * bits, "layers of an iso-surface", err);
    if (s) return s;
    for (size_t i = 0; i < 4; i++) t->edge[i >> 1][i & 1] = t->edge_z + (i + 1) * area;
    t->inside[1] = t->inside[0] + bits;
    for (int e = 0; e < 12; e++) {
        const int at = edge_start(e), axis = e >> 2;
        const size_t slot = (size_t)(at >> 1 & 1) * t->nx + (size_t)(at & 1);
        for (size_t odd = 0; odd < 2; odd++) {
            const size_t layer = (odd + (size_t)(at >> 2)) & 1;
            t->edge_slot[odd][e] = axis == 2 ? slot : slot + (1 + 2 * layer + (size_t)axis) * area;
        }
        t->faces[e] = edge_faces(e);
    }
    return SDM_OK;
}

sdm_status sdm_isosurface(const sdm_grid *grid, const float *values, float level, sdm_mesh *out,
                          bool *cut, sdm_error *err)
{
    if (!grid || !values || !out) return sdm_fail(err, SDM_E_ARG, "sdm_isosurface: NULL argument");
    sdm_status s = sdm_grid_check(grid, err);
    if (!s) s = check_values(grid, values, level, err);
    if (s) return s;
    out->n_vert = out->n_tri = 0;
    tracer t = {
        .g = grid, .values = values, .level = (double)level, .b = {.path = "", .mesh = out}};
    t.nx = (size_t)grid->n[0];
    t.ny = (size_t)grid->n[1];
    t.nz = (size_t)grid->n[2];
    t.words = (t.nx + 63) / 64;
    // sign of the determinant of the direction matrix
    const double *r = grid->dir;
    t.mirrored = r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
                     r[2] * (r[3] * r[7] - r[4] * r[6]) <
                 0;
    s = make_layers(&t, err);
    if (!s) s = trace_grid(&t, err);
    sdm_free(t.inside[0]);
    sdm_free(t.edge_z);
    if (s) sdm_mesh_dispose(out);
    if (!s && cut) *cut = t.cut;
    return s;
}
