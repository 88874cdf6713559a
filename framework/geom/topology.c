/* Which vertices coincide and which triangles share which edges: hashing, no sorting. */
#include "topology.h"

#include <string.h>

#include "sdm/memory.h"

static size_t table_size(size_t n)
{
    size_t size = 16;
    while (size < 2 * n) size *= 2;
    return size;
}

static uint64_t mix(uint64_t x)
{
    // finaliser of splitmix64
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static uint64_t bits_of(double x)
{
    x += 0.0; // -0 counts as 0
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

static sdm_status weld_vertices(const sdm_mesh *m, uint32_t *weld, sdm_error *err)
{
    const size_t size = table_size(m->n_vert);
    uint32_t *table;
    const sdm_status s = SDM_ALLOC(&table, size, "vertex table", err);
    if (s) return s;
    memset(table, 0xff, size * sizeof *table);
    for (size_t v = 0; v < m->n_vert; v++) {
        const double *p = &m->vert[3 * v];
        size_t slot = mix(bits_of(p[0]) + mix(bits_of(p[1]) + mix(bits_of(p[2])))) & (size - 1);
        for (;; slot = (slot + 1) & (size - 1)) {
            const uint32_t u = table[slot];
            if (u == SDM_NONE) {
                table[slot] = weld[v] = (uint32_t)v;
                break;
            }
            const double *q = &m->vert[3 * (size_t)u];
            if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2]) {
                weld[v] = u;
                break;
            }
        }
    }
    sdm_free(table);
    return SDM_OK;
}

static sdm_status find_edges(sdm_topology *t, sdm_error *err)
{
    const size_t size = table_size(3 * t->n_tri);
    uint32_t *table;
    sdm_status s = SDM_ALLOC(&table, size, "edge table", err);
    if (s) return s;
    memset(table, 0xff, size * sizeof *table);
    for (size_t h = 0; h < 3 * t->n_tri; h++) {
        const uint32_t *tri = &t->tri[h / 3 * 3];
        t->edge[h] = t->next[h] = SDM_NONE;
        if (tri[0] == tri[1] || tri[1] == tri[2] || tri[2] == tri[0]) continue;
        const uint32_t from = tri[h % 3], to = tri[(h + 1) % 3];
        const uint32_t lo = from < to ? from : to, hi = from < to ? to : from;
        size_t slot = mix((uint64_t)lo << 32 | hi) & (size - 1);
        while (table[slot] != SDM_NONE && (t->edges[table[slot]].lo != lo || t->edges[table[slot]].hi != hi))
            slot = (slot + 1) & (size - 1);
        if (table[slot] == SDM_NONE) {
            table[slot] = (uint32_t)t->n_edges;
            t->edges[t->n_edges++] = (sdm_edge){.lo = lo, .hi = hi, .first = SDM_NONE};
        }
        sdm_edge *e = &t->edges[table[slot]];
        t->edge[h] = table[slot];
        t->next[h] = e->first;
        e->first = (uint32_t)h;
        if (from == lo)
            e->n_up++;
        else
            e->n_down++;
    }
    sdm_free(table);
    return SDM_OK;
}

sdm_status sdm_topology_build(const sdm_mesh *m, sdm_topology *t, sdm_error *err)
{
    t->n_vert = m->n_vert;
    t->n_tri = m->n_tri;
    sdm_status s = SDM_ALLOC(&t->weld, m->n_vert, "welded vertices", err);
    if (!s) s = SDM_ALLOC(&t->tri, 3 * m->n_tri, "welded triangles", err);
    if (!s) s = SDM_ALLOC(&t->edge, 3 * m->n_tri, "half-edges", err);
    if (!s) s = SDM_ALLOC(&t->next, 3 * m->n_tri, "half-edges", err);
    if (!s) s = SDM_ALLOC(&t->edges, 3 * m->n_tri, "edges", err);
    if (!s) s = weld_vertices(m, t->weld, err);
    if (s) return s;
    for (size_t i = 0; i < 3 * m->n_tri; i++) t->tri[i] = t->weld[m->tri[i]];
    return find_edges(t, err);
}

void sdm_topology_dispose(sdm_topology *t)
{
    sdm_free(t->weld);
    sdm_free(t->tri);
    sdm_free(t->edge);
    sdm_free(t->next);
    sdm_free(t->edges);
    *t = (sdm_topology){0};
}

uint32_t sdm_topology_neighbour(const sdm_topology *t, uint32_t h)
{
    if (t->edge[h] == SDM_NONE) return SDM_NONE;
    const sdm_edge *e = &t->edges[t->edge[h]];
    if (e->n_up != 1 || e->n_down != 1) return SDM_NONE;
    return (e->first == h ? t->next[h] : e->first) / 3;
}

uint32_t sdm_forest_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

void sdm_forest_join(uint32_t *parent, uint32_t i, uint32_t j)
{
    i = sdm_forest_root(parent, i);
    j = sdm_forest_root(parent, j);
    if (i < j)
        parent[j] = i;
    else
        parent[i] = j;
}
