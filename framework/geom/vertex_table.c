/* Vertices by their cell of a coarse grid, hashed; near a side of a cell the one beyond it is asked, too. */
#include "vertex_table.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

#define CELL 1024.0 // in tolerances: so large that hardly a vertex is near a side

static uint64_t mix(uint64_t x)
{
    // finaliser of splitmix64
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static size_t place_of(const sdm_vertex_table *t, const double cell[3])
{
    uint64_t h = 0;
    for (int a = 0; a < 3; a++) {
        uint64_t bits;
        const double c = cell[a] + 0.0; // -0 counts as 0
        memcpy(&bits, &c, sizeof bits);
        h = mix(bits + h);
    }
    return h & (t->size - 1);
}

static double cell_of(const sdm_vertex_table *t, double x) { return floor(x / (CELL * t->tolerance)); }

void sdm_vertex_table_find(const sdm_vertex_table *t, const double *vert, uint32_t n_vert, const double x[3],
                           uint32_t *v)
{
    double low[3], high[3];
    *v = n_vert;
    if (!t->size) return;
    for (int a = 0; a < 3; a++) {
        low[a] = cell_of(t, x[a] - t->tolerance);
        high[a] = cell_of(t, x[a] + t->tolerance);
    }
    for (int side = 0; side < 8; side++) {
        double cell[3];
        int again = 0;
        for (int a = 0; a < 3; a++) {
            cell[a] = side >> a & 1 ? high[a] : low[a];
            again |= (side >> a & 1) && high[a] == low[a];
        }
        if (again) continue;
        for (size_t i = place_of(t, cell); t->place[i]; i = (i + 1) & (t->size - 1)) {
            const uint32_t u = t->place[i] - 1;
            const double *y = &vert[3 * (size_t)u];
            if (u >= n_vert || !(fabs(y[0] - x[0]) <= t->tolerance && fabs(y[1] - x[1]) <= t->tolerance &&
                                 fabs(y[2] - x[2]) <= t->tolerance))
                continue;
            *v = u;
            return;
        }
    }
}

static void put(sdm_vertex_table *t, const double *vert, uint32_t v)
{
    double cell[3];
    for (int a = 0; a < 3; a++) cell[a] = cell_of(t, vert[3 * (size_t)v + (size_t)a]);
    size_t i = place_of(t, cell);
    while (t->place[i]) i = (i + 1) & (t->size - 1);
    t->place[i] = v + 1;
    t->n++;
}

sdm_status sdm_vertex_table_add(sdm_vertex_table *t, const double *vert, uint32_t v, sdm_error *err)
{
    if (2 * (t->n + 1) > t->size) {
        sdm_vertex_table bigger = {.tolerance = t->tolerance, .size = t->size ? 2 * t->size : 256};
        const sdm_status s = SDM_ALLOC(&bigger.place, bigger.size, "vertices of cut triangles", err);
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
