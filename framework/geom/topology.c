/* Which vertices coincide and which triangles share which edges: hashing for the first, lists of each vertex for the second. */
#include "topology.h"

#include <string.h>

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

static sdm_status weld_vertices(const sdm_mesh *m, sdm_arena *arena, uint32_t *weld, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_LOW];
    const size_t size = table_size(m->n_vert);
    uint32_t *table; // vertex + 1; 0: free
    const sdm_status s = SDM_TAKE(arena, SDM_LOW, &table, size, "vertex table", err);
    if (s) return s;
    for (size_t v = 0; v < m->n_vert; v++) {
        const double *p = &m->vert[3 * v];
        size_t slot = mix(bits_of(p[0]) + mix(bits_of(p[1]) + mix(bits_of(p[2])))) & (size - 1);
        for (;; slot = (slot + 1) & (size - 1)) {
            const uint32_t u = table[slot] - 1;
            if (u == SDM_NONE) {
                weld[v] = (uint32_t)v;
                table[slot] = (uint32_t)v + 1;
                break;
            }
            const double *q = &m->vert[3 * (size_t)u];
            if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2]) {
                weld[v] = u;
                break;
            }
        }
    }
    sdm_arena_release(arena, SDM_LOW, before);
    return SDM_OK;
}

static bool repeats_vertex(const uint32_t *t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; }

static inline uint32_t lower(uint32_t a, uint32_t b) { return a < b ? a : b; }
static inline uint32_t higher(uint32_t a, uint32_t b) { return a < b ? b : a; }

/* Turns counts[v + 1] into the starts of lists. */
static void counts_to_starts(uint32_t *first, size_t n)
{
    for (size_t i = 0; i < n; i++) first[i + 1] += first[i];
}

/* After filling, first[v] is the end of list v: back to the starts. */
static void ends_to_starts(uint32_t *first, size_t n)
{
    memmove(first + 1, first, n * sizeof *first);
    first[0] = 0;
}

/* A half-edge in the list of the lower of its vertices. */
typedef struct half_edge {
    uint32_t hi, index;
} half_edge;

/* The half-edges of each vertex: those that leave it, and those of which it is the lower end (starts: lo). By counting. */
static void list_half_edges(sdm_topology *t, uint32_t *lo, half_edge *list)
{
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        if (repeats_vertex(v)) continue;
        for (int k = 0; k < 3; k++) {
            t->first[v[k] + 1]++;
            lo[lower(v[k], v[(k + 1) % 3]) + 1]++;
        }
    }
    counts_to_starts(t->first, t->n_vert);
    counts_to_starts(lo, t->n_vert);
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        if (repeats_vertex(v)) continue;
        for (int k = 0; k < 3; k++) {
            const uint32_t h = (uint32_t)(3 * i) + (uint32_t)k, to = v[(k + 1) % 3];
            t->leaving[t->first[v[k]]++] = h;
            list[lo[lower(v[k], to)]++] = (half_edge){higher(v[k], to), h};
        }
    }
    ends_to_starts(t->first, t->n_vert);
    ends_to_starts(lo, t->n_vert);
}

/* While the edges of vertex lo are numbered: the number of its edge to each other vertex; valid where `lo` is that vertex
   + 1. */
typedef struct mark {
    uint32_t lo, edge;
} mark;

static void number_edges(sdm_topology *t, const uint32_t *lo, const half_edge *list, mark *seen)
{
    uint32_t n = 0;
    for (uint32_t v = 0; v < t->n_vert; v++) {
        for (uint32_t i = lo[v]; i < lo[v + 1]; i++) {
            // without branches: every second half-edge is the first of its edge
            mark *m = &seen[list[i].hi];
            const bool is_new = m->lo != v + 1;
            const uint32_t edge = is_new ? n : m->edge;
            *m = (mark){v + 1, edge};
            t->edge[list[i].index] = edge;
            n += is_new;
        }
    }
    t->n_edges = n;
}

static void link_edges(sdm_topology *t)
{
    for (size_t i = 0; i < t->n_edges; i++) t->edges[i].first = SDM_NONE;
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        for (int k = 0; k < 3; k++) {
            const size_t h = 3 * i + (size_t)k;
            if (t->edge[h] == SDM_NONE) {
                t->next[h] = SDM_NONE;
                continue;
            }
            const uint32_t from = v[k], to = v[(k + 1) % 3];
            sdm_edge *e = &t->edges[t->edge[h]];
            e->lo = lower(from, to);
            e->hi = higher(from, to);
            e->n_up += from < to;
            e->n_down += from > to;
            t->next[h] = e->first;
            e->first = (uint32_t)h;
        }
    }
}

static sdm_status find_edges(sdm_topology *t, sdm_arena *arena, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_LOW];
    uint32_t *lo = NULL;
    half_edge *list = NULL;
    mark *seen = NULL;
    sdm_status s = SDM_TAKE(arena, SDM_LOW, &lo, t->n_vert + 1, "half-edges", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &list, 3 * t->n_tri, "half-edges", err);
    if (!s) s = SDM_TAKE(arena, SDM_LOW, &seen, t->n_vert, "half-edges", err);
    if (!s) {
        memset(t->edge, 0xff, 3 * t->n_tri * sizeof *t->edge);
        list_half_edges(t, lo, list);
        number_edges(t, lo, list, seen);
        s = SDM_TAKE(arena, SDM_HIGH, &t->edges, t->n_edges, "edges", err);
    }
    if (!s) link_edges(t);
    sdm_arena_release(arena, SDM_LOW, before);
    return s;
}

size_t sdm_topology_bytes(const sdm_mesh *m, size_t *scratch)
{
    *scratch += table_size(m->n_vert) * sizeof(uint32_t) + m->n_vert * (sizeof(mark) + sizeof(uint32_t)) +
                3 * m->n_tri * sizeof(half_edge);
    return m->n_vert * 2 * sizeof(uint32_t) + m->n_tri * (12 * sizeof(uint32_t) + 3 * sizeof(sdm_edge));
}

sdm_status sdm_topology_build(const sdm_mesh *m, sdm_arena *arena, sdm_topology *t, sdm_error *err)
{
    if (m->n_tri > UINT32_MAX / 3 - 1) // half-edges are numbered
        return sdm_fail(err, SDM_E_MESH, "mesh of %zu triangles, at most %u can be prepared", m->n_tri,
                        UINT32_MAX / 3 - 1);
    t->n_vert = m->n_vert;
    t->n_tri = m->n_tri;
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->weld, m->n_vert, "welded vertices", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->tri, 3 * m->n_tri, "welded triangles", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->edge, 3 * m->n_tri, "half-edges", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->next, 3 * m->n_tri, "half-edges", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &t->first, m->n_vert + 1, "half-edges", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->leaving, 3 * m->n_tri, "half-edges", err);
    if (!s) s = weld_vertices(m, arena, t->weld, err);
    if (s) return s;
    for (size_t i = 0; i < 3 * m->n_tri; i++) t->tri[i] = t->weld[m->tri[i]];
    return find_edges(t, arena, err);
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
