/* Vertices by their cell of a coarse grid, hashed; near a side of a cell the one beyond it is
 * asked, too. */
#include "vertex_table.h"

#include <math.h>

#include "sdm/internal/rng.h"
#include "sdm/memory.h"

#define CELL 1024.0 // in tolerances: so large that hardly a vertex is near a side

/* Cells are numbered towards zero: the one at zero is twice as wide. */
typedef struct cell {
    int64_t x[3];
} cell;

static cell cell_of(const sdm_vertex_table *t, const double x[3], double shift)
{
    const double size = CELL * t->tolerance;
    return (cell){{(int64_t)((x[0] + shift) / size), (int64_t)((x[1] + shift) / size),
                   (int64_t)((x[2] + shift) / size)}};
}

static size_t place_of(const sdm_vertex_table *t, const cell *c)
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
    // axes along which the vertex is near a side; all combinations of them
    unsigned near = 0, side = 0;
    for (int a = 0; a < 3; a++) near |= (unsigned)(low.x[a] != high.x[a]) << a;
    do {
        cell c;
        for (int a = 0; a < 3; a++) c.x[a] = side >> a & 1 ? high.x[a] : low.x[a];
        for (size_t i = place_of(t, &c); t->place[i]; i = (i + 1) & (t->size - 1)) {
            const uint32_t u = t->place[i] - 1;
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

static void put(sdm_vertex_table *t, const double *vert, uint32_t v)
{
    const cell c = cell_of(t, &vert[3 * (size_t)v], 0);
    size_t i = place_of(t, &c);
    while (t->place[i]) i = (i + 1) & (t->size - 1);
    t->place[i] = v + 1;
    t->n++;
}

sdm_status sdm_vertex_table_add(sdm_vertex_table *t, const double *vert, uint32_t v, sdm_error *err)
{
    if (2 * (t->n + 1) > t->size) {
        sdm_vertex_table bigger = {.tolerance = t->tolerance, .size = t->size ? 2 * t->size : 256};
        const sdm_status s =
            SDM_ALLOC(&bigger.place, bigger.size, "vertices of cut triangles", err);
        if (s) return s;
        for (size_t i = 0; i < t->size; i++)
            if (t->place[i]) put(&bigger, vert, t->place[i] - 1);
        sdm_free(t->place);
        *t = bigger;
    }
    put(t, vert, v);
    return SDM_OK;
}

void sdm_vertex_table_dispose(sdm_vertex_table *t)
{
    sdm_free(t->place);
    *t = (sdm_vertex_table){0};
}
