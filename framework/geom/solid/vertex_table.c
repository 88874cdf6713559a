/* Spatial hash: vertices are hashed by their cell of a coarse grid. For a point near the boundary
 * of a cell the search includes the neighbouring cell beyond this boundary. */
#include "vertex_table.h"

#include <math.h>

#include "sdm/internal/rng.h"
#include "sdm/memory.h"

#define CELL 1024.0 // edge of a cell in tolerances; large, so that few points are near a boundary

/* Index of a cell: coordinate / edge, truncated towards zero, so that cell 0 is twice as wide. */
typedef struct cell {
    int64_t x[3];
} cell;

/* The cell of x moved by `shift` along each axis. */
static cell cell_of(const sdm_vertex_table *t, const double x[3], double shift)
{
    const double size = CELL * t->tolerance;
    return (cell){{(int64_t)((x[0] + shift) / size), (int64_t)((x[1] + shift) / size),
                   (int64_t)((x[2] + shift) / size)}};
}

/* First index to probe in the table for cell c. */
static size_t cell_hash(const sdm_vertex_table *t, const cell *c)
{
    const uint64_t y = (uint64_t)c->x[1] * 0x9e3779b97f4a7c15u,
                   z = (uint64_t)c->x[2] * 0xd1b54a32d192ed03u;
    return sdm_mix64((uint64_t)c->x[0] + y + z) & (t->size - 1);
}

void sdm_vertex_table_find(const sdm_vertex_table *t, const double *vert, uint32_t n_vert,
                           const double x[3], uint32_t *v)
{
    *v = n_vert;
    if (!t->size) return;
    const cell low = cell_of(t, x, -t->tolerance), high = cell_of(t, x, t->tolerance);
    // bits of `near`: axes along which x is near a boundary of its cell; `side` runs through all
    // subsets of these bits
    unsigned near = 0, side = 0;
    for (int a = 0; a < 3; a++) near |= (unsigned)(low.x[a] != high.x[a]) << a;
    do {
        cell c;
        for (int a = 0; a < 3; a++) c.x[a] = side >> a & 1 ? high.x[a] : low.x[a];
        for (size_t i = cell_hash(t, &c); t->entry[i]; i = (i + 1) & (t->size - 1)) {
            const uint32_t u = t->entry[i] - 1;
            const double *y = &vert[3 * (size_t)u];
            if (u >= n_vert ||
                !(fabs(y[0] - x[0]) <= t->tolerance && fabs(y[1] - x[1]) <= t->tolerance &&
                  fabs(y[2] - x[2]) <= t->tolerance))
                continue;
            *v = u;
            return;
        }
        side = (side - near) & near;
    } while (side);
}

/* Inserts vertex v; the table must have a free entry. */
static void table_insert(sdm_vertex_table *t, const double *vert, uint32_t v)
{
    const cell c = cell_of(t, &vert[3 * (size_t)v], 0);
    size_t i = cell_hash(t, &c);
    while (t->entry[i]) i = (i + 1) & (t->size - 1);
    t->entry[i] = v + 1;
    t->n++;
}

sdm_status sdm_vertex_table_add(sdm_vertex_table *t, const double *vert, uint32_t v, sdm_error *err)
{
    if (2 * (t->n + 1) > t->size) {
        // at most half full: rehash into a table of twice the size
        sdm_vertex_table bigger = {.tolerance = t->tolerance, .size = t->size ? 2 * t->size : 256};
        const sdm_status s =
            SDM_ALLOC(&bigger.entry, bigger.size, "vertices of cut triangles", err);
        if (s) return s;
        for (size_t i = 0; i < t->size; i++)
            if (t->entry[i]) table_insert(&bigger, vert, t->entry[i] - 1);
        sdm_free(t->entry);
        *t = bigger;
    }
    table_insert(t, vert, v);
    return SDM_OK;
}

void sdm_vertex_table_dispose(sdm_vertex_table *t)
{
    sdm_free(t->entry);
    *t = (sdm_vertex_table){0};
}
