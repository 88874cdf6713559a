/* Welds coinciding vertices with a hash table and finds the edges with one list of half-edges per
 * vertex. */
#include "topology.h"

#include <string.h>

#include "sdm/internal/rng.h"

/* Size of the hash table for n vertices: a power of two, at most half full. */
static size_t table_size(size_t n)
{
    size_t size = 16;
    while (size < 2 * n) size *= 2;
    return size;
}

static uint64_t bits_of(double x)
{
    x += 0.0; // -0 counts as 0
    uint64_t b;
    memcpy(&b, &x, sizeof b);
    return b;
}

/* weld[v] = lowest index of a vertex with the coordinates of v. */
static sdm_status weld_vertices(const sdm_mesh *m, sdm_arena *arena, uint32_t *weld, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_LOW];
    const size_t size = table_size(m->n_vert);
    uint32_t *table; // [size] hash table with linear probing: vertex + 1; 0: free
    const sdm_status s = SDM_TAKE(arena, SDM_LOW, &table, size, "vertex table", err);
    if (s) return s;
    for (size_t v = 0; v < m->n_vert; v++) {
        const double *p = &m->vert[3 * v];
        // odd factors prevent equal sums, and thus collisions, for the points of a regular grid
        const uint64_t x = bits_of(p[0]), y = bits_of(p[1]), z = bits_of(p[2]);
        size_t slot = sdm_mix64(x + y * 0x9e3779b97f4a7c15u + z * 0xd1b54a32d192ed03u) & (size - 1);
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

static inline uint32_t lower(uint32_t a, uint32_t b) { return a < b ? a : b; }
static inline uint32_t higher(uint32_t a, uint32_t b) { return a < b ? b : a; }

/* A half-edge in the list of the lower of its two vertices. */
typedef struct half_edge {
    uint32_t hi;    // the higher vertex
    uint32_t index; // 2 * half-edge + (1 if it runs from the lower to the higher vertex)
} half_edge;

/* Counting sort of the half-edges by their lower vertex: those of v become
 * list[lo[v] .. lo[v + 1]), in ascending order. lo[n_vert + 2] is zero on entry. */
static void list_half_edges(const sdm_topology *t, uint32_t *lo, half_edge *list)
{
    // lo[v + 2] = number of half-edges of v; after the prefix sum lo[v + 1] = start of v's list,
    // which filling advances to its end, the start of the next list
    uint32_t *count = lo + 2;
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        if (sdm_repeats_vertex(v)) continue;
        count[lower(v[0], v[1])]++;
        count[lower(v[1], v[2])]++;
        count[lower(v[2], v[0])]++;
    }
    for (size_t v = 1; v < t->n_vert; v++) count[v] += count[v - 1];
    uint32_t *next = lo + 1;
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        if (sdm_repeats_vertex(v)) continue;
        for (uint32_t k = 0; k < 3; k++) {
            const uint32_t h = (uint32_t)(3 * i) + k, from = v[k], to = v[(k + 1) % 3];
            list[next[lower(from, to)]++] = (half_edge){higher(from, to), 2 * h + (from < to)};
        }
    }
}

/* Entry of a vertex w: lo - 1 is the last lower vertex found so far that has an edge to w, `edge`
 * is the index of this edge. lo = 0: none found. */
typedef struct mark {
    uint32_t lo, edge;
} mark;

/* Fills t->edges, t->edge and t->next from the sorted half-edges. seen[n_vert] is zero on entry. */
static void make_edges(sdm_topology *t, const uint32_t *lo, const half_edge *list, mark *seen)
{
    uint32_t n = 0;
    for (uint32_t v = 0; v < t->n_vert; v++) {
        for (uint32_t i = lo[v]; i < lo[v + 1]; i++) {
            // The edge of this half-edge: a new one, or the one in seen[]. Without branches, which
            // would be mispredicted: every second half-edge is the first of its edge.
            const half_edge x = list[i];
            const uint32_t h = x.index / 2, is_up = x.index % 2;
            mark *m = &seen[x.hi];
            const bool is_new = m->lo != v + 1;
            const uint32_t edge = is_new ? n : m->edge, keep = is_new - 1u;
            *m = (mark){v + 1, edge};
            n += is_new;
            // `keep` masks the members of the edge: 0 for a new edge, all bits otherwise
            sdm_edge *e = &t->edges[edge];
            t->edge[h] = edge;
            t->next[h] = e->first | ~keep;
            *e = (sdm_edge){v, x.hi, (e->n_up & keep) + is_up, (e->n_down & keep) + !is_up, h};
        }
    }
    t->n_edges = n;
}

static sdm_status find_edges(sdm_topology *t, sdm_arena *arena, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_LOW];
    uint32_t *lo = NULL;
    half_edge *list = NULL;
    mark *seen = NULL;
    sdm_status s = SDM_TAKE(arena, SDM_LOW, &lo, t->n_vert + 2, "half-edges", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_LOW, &list, 3 * t->n_tri, "half-edges", err);
    if (!s) s = SDM_TAKE(arena, SDM_LOW, &seen, t->n_vert, "half-edges", err);
    if (!s) {
        list_half_edges(t, lo, list);
        make_edges(t, lo, list, seen);
    }
    sdm_arena_release(arena, SDM_LOW, before);
    return s;
}

sdm_status sdm_topology_build(const sdm_mesh *m, sdm_arena *arena, sdm_topology *t, sdm_error *err)
{
    // 2 * half-edge + direction must fit in 32 bits
    if (m->n_tri > UINT32_MAX / 6 - 1)
        return sdm_fail(err, SDM_E_MESH, "mesh of %zu triangles, at most %u can be prepared",
                        m->n_tri, UINT32_MAX / 6 - 1);
    t->n_vert = m->n_vert;
    t->n_tri = m->n_tri;
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->weld, m->n_vert, "welded vertices", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->tri, 3 * m->n_tri, "welded triangles", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->edge, 3 * m->n_tri, "half-edges", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->next, 3 * m->n_tri, "half-edges", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &t->edges, 3 * m->n_tri, "edges", err);
    if (!s) s = weld_vertices(m, arena, t->weld, err);
    if (s) return s;
    // triangles with welded vertices; degenerate ones get no half-edges (all bytes 0xff: SDM_NONE)
    for (size_t i = 0; i < m->n_tri; i++) {
        uint32_t *v = &t->tri[3 * i];
        for (size_t k = 0; k < 3; k++) v[k] = t->weld[m->tri[3 * i + k]];
        if (sdm_repeats_vertex(v)) memset(&t->edge[3 * i], 0xff, 3 * sizeof *v);
        if (sdm_repeats_vertex(v)) memset(&t->next[3 * i], 0xff, 3 * sizeof *v);
    }
    return find_edges(t, arena, err);
}

uint32_t sdm_topology_neighbour(const sdm_topology *t, uint32_t h)
{
    if (t->edge[h] == SDM_NONE) return SDM_NONE;
    const sdm_edge *e = &t->edges[t->edge[h]];
    if (e->n_up != 1 || e->n_down != 1) return SDM_NONE;
    return (e->first == h ? t->next[h] : e->first) / 3;
}

void sdm_topology_parts(const sdm_topology *t, uint32_t *parent)
{
    for (size_t i = 0; i < t->n_tri; i++) parent[i] = (uint32_t)i;
    for (size_t i = 0; i < t->n_edges; i++)
        for (uint32_t h = t->edges[i].first; t->next[h] != SDM_NONE; h = t->next[h])
            sdm_forest_join(parent, h / 3, t->next[h] / 3);
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
