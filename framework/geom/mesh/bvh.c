/* Bounding volume hierarchy, built by halving space: a node is split in the middle of the longest
   side of the box of the middles of its triangles' boxes. On surface meshes queries are as fast as
   with the surface area heuristic, and the build is several times faster. */
#include "bvh.h"

#include <math.h>
#include <string.h>

#include "simd/lanes_two.h"

#define LEAF 4u
#define FULL                                                                                       \
    ((size_t)8) // small nodes are cut where they leave as many: clusters of the map are full then
#define MOST_SORTED ((size_t)32) // nodes of so many are cut there
#define MIDDLE_DEPTH 64 // below it nodes are halved in their order: bounds the depth of the tree

/* Middles are in units of the mesh's size: they only choose the splits, float is enough. */
typedef struct item {
    float middle[3];
    uint32_t tri;
} item;

typedef int32_t i32x4 __attribute__((vector_size(16)));
typedef float f32x4 __attribute__((vector_size(16)));

typedef struct part {
    uint32_t first, count; // as in sdm_bvh_node
} part;

typedef struct builder {
    item *item, *spare;
    part *part;
    size_t n_part;
} builder;

/* Sorts list[n], n <= MOST_SORTED, along an axis: each goes to the place that as many are before.
 * No branch depends on what is compared. */
static void sort(item *list, size_t n, int axis)
{
    i32x4 key[MOST_SORTED / 4];
    item copy[MOST_SORTED];
    memcpy(copy, list, n * sizeof *list);
    // numbers of at least 0 are in the order of their bits; the last five make all different
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &list[i].middle[axis], sizeof bits);
        key[i / 4][i % 4] = (int32_t)((bits & ~31u) | (uint32_t)i);
    }
    for (size_t i = n; i % 4; i++) key[i / 4][i % 4] = INT32_MAX;
    for (size_t i = 0; i < n; i++) {
        const int32_t own = key[i / 4][i % 4];
        const i32x4 all = {own, own, own, own};
        i32x4 before = {0, 0, 0, 0};
        for (size_t j = 0; j < (n + 3) / 4; j++) before -= key[j] < all;
        list[before[0] + before[1] + before[2] + before[3]] = copy[i];
    }
}

/* As near to `left` as a multiple of FULL can be, in the order along an axis. */
static size_t cut_to_full(item *list, size_t n, int axis, size_t left)
{
    sort(list, n, axis);
    const size_t full = (left + FULL / 2) / FULL * FULL;
    return full < FULL ? FULL : full < n ? full : full - FULL;
}

/* Its middle; the last lane means nothing. */
static inline f32x4 item_bits(const item *x)
{
    f32x4 bits;
    memcpy(&bits, x, sizeof bits);
    return bits;
}

/* x where a < b, else y */
static inline f32x4 select_less(f32x4 a, f32x4 b, f32x4 x, f32x4 y)
{
    const i32x4 m = a < b;
    return (f32x4)((m & (i32x4)x) | (~m & (i32x4)y));
}

/* Reorders list[n] into two parts and returns the size of the first, 0 < size < n. */
static size_t split(const builder *w, item *list, size_t n, int depth)
{
    if (n <= FULL || depth >= MIDDLE_DEPTH) return n / 2;
    f32x4 lo = item_bits(list), hi = lo;
    for (size_t i = 1; i < n; i++) {
        const f32x4 x = item_bits(&list[i]);
        lo = select_less(x, lo, x, lo);
        hi = select_less(hi, x, x, hi);
    }
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (hi[a] - lo[a] > hi[axis] - lo[axis]) axis = a;
    const float at = 0.5f * (lo[axis] + hi[axis]);
    // without branches: which side comes next cannot be foreseen
    size_t left = 0, right = 0;
    for (size_t i = 0; i < n; i++) {
        const item it = list[i];
        const size_t is_left = it.middle[axis] < at;
        list[left] = it;
        w->spare[right] = it;
        left += is_left;
        right += !is_left;
    }
    memcpy(list + left, w->spare, right * sizeof *list);
    if (n <= MOST_SORTED) return cut_to_full(list, n, axis, left);
    return left > 0 && left < n ? left : n / 2; // else all middles coincide
}

static void build_part(builder *w, uint32_t index, size_t first, size_t n, int depth)
{
    if (n <= LEAF) {
        w->part[index] = (part){(uint32_t)first, (uint32_t)n};
        return;
    }
    const size_t left = split(w, w->item + first, n, depth);
    const uint32_t child = (uint32_t)w->n_part;
    w->n_part += 2;
    w->part[index] = (part){child, 0};
    build_part(w, child, first, left, depth + 1);
    build_part(w, child + 1, first + left, n - left, depth + 1);
}

static inline const double *corner(const sdm_mesh *m, size_t t, size_t k)
{
    return &m->vert[3 * (size_t)m->tri[3 * t + k]];
}

/* Where middles are measured from, and in what. */
typedef struct units {
    double origin[3], scale;
} units;

static units units_of(const double lo[3], const double hi[3])
{
    double size = 0;
    for (int a = 0; a < 3; a++) size = fmax(size, hi[a] - lo[a]);
    return (units){{lo[0], lo[1], lo[2]}, size > 0 && 1 / size < INFINITY ? 1 / size : 0};
}

static inline item item_of(const sdm_mesh *m, const units *u, size_t t)
{
    const double *v[3] = {corner(m, t, 0), corner(m, t, 1), corner(m, t, 2)};
    item it = {.tri = (uint32_t)t};
    for (int a = 0; a < 3; a++) {
        const double low = v[0][a] < v[1][a] ? v[0][a] : v[1][a],
                     high = v[0][a] < v[1][a] ? v[1][a] : v[0][a];
        const double from = v[2][a] < low ? v[2][a] : low, to = v[2][a] > high ? v[2][a] : high;
        it.middle[a] = (float)(((from - u->origin[a]) + (to - u->origin[a])) * u->scale);
    }
    return it;
}

/* A box: x and y in lanes. */
typedef struct box {
    v2d lo, hi;
    double lo_z, hi_z;
} box;

static inline void join(box *b, const double lo[3], const double hi[3])
{
    b->lo = d2_lesser(d2_load(lo), b->lo);
    b->hi = d2_greater(d2_load(hi), b->hi);
    b->lo_z = lo[2] < b->lo_z ? lo[2] : b->lo_z;
    b->hi_z = hi[2] > b->hi_z ? hi[2] : b->hi_z;
}

/* Boxes from the leaves up: children come after their parent. */
static void fill_nodes(const sdm_mesh *m, const builder *w, sdm_bvh *b)
{
    for (size_t i = 0; i < b->n_tri; i++) b->order[i] = w->item[i].tri;
    for (size_t i = b->n_node; i-- > 0;) {
        const part p = w->part[i];
        box x = {d2_all(INFINITY), d2_all(-INFINITY), INFINITY, -INFINITY};
        for (uint32_t c = p.first; !p.count && c < p.first + 2; c++)
            join(&x, b->node[c].lo, b->node[c].hi);
        for (uint32_t k = p.first; k < p.first + p.count; k++)
            for (size_t c = 0; c < 3; c++)
                join(&x, corner(m, b->order[k], c), corner(m, b->order[k], c));
        b->node[i] = (sdm_bvh_node){
            {x.lo[0], x.lo[1], x.lo_z}, {x.hi[0], x.hi[1], x.hi_z}, p.first, p.count};
    }
}

size_t sdm_bvh_bytes(size_t n_tri, size_t *scratch)
{
    *scratch += n_tri * 2 * (sizeof(item) + sizeof(part));
    return n_tri * (2 * sizeof(sdm_bvh_node) + sizeof(uint32_t));
}

static sdm_status start(builder *w, size_t n_tri, sdm_arena *arena, sdm_bvh *b, sdm_error *err)
{
    b->n_tri = n_tri;
    w->n_part = 1;
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w->item, n_tri, "tree", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w->spare, n_tri, "tree", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w->part, 2 * n_tri, "tree", err);
    return s ? s : SDM_TAKE_UNSET(arena, SDM_LOW, &b->order, n_tri, "tree", err);
}

static sdm_status finish(const sdm_mesh *m, const builder *w, sdm_arena *arena, sdm_bvh *b,
                         sdm_error *err)
{
    b->n_node = w->n_part;
    const sdm_status s = SDM_TAKE_UNSET(arena, SDM_LOW, &b->node, b->n_node, "tree", err);
    if (!s) fill_nodes(m, w, b);
    return s;
}

sdm_status sdm_bvh_build(const sdm_mesh *m, sdm_arena *arena, sdm_bvh *b, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    builder w = {0};
    sdm_status s = start(&w, m->n_tri, arena, b, err);
    if (!s) {
        box x = {d2_all(INFINITY), d2_all(-INFINITY), INFINITY, -INFINITY};
        for (size_t t = 0; t < m->n_tri; t++)
            for (size_t c = 0; c < 3; c++) join(&x, corner(m, t, c), corner(m, t, c));
        const units u =
            units_of((double[3]){x.lo[0], x.lo[1], x.lo_z}, (double[3]){x.hi[0], x.hi[1], x.hi_z});
        for (size_t t = 0; t < m->n_tri; t++) w.item[t] = item_of(m, &u, t);
        build_part(&w, 0, 0, m->n_tri, 0);
        s = finish(m, &w, arena, b, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}

/* A mesh of pieces of the triangles of another. */
typedef struct pieces {
    const sdm_bvh *from;
    const sdm_mesh *mesh;
    units units;
    uint32_t *first;   // [n_tri + 1] the pieces of triangle t of the other mesh are first[t] ..
                       // first[t + 1]
    uint32_t *in_node; // [n_node] pieces below a node
} pieces;

static void count_pieces(const pieces *p, const uint32_t *source)
{
    const sdm_bvh *from = p->from;
    for (size_t i = 0; i < p->mesh->n_tri; i++) p->first[source[i] + 1]++;
    for (size_t t = 0; t < from->n_tri; t++) p->first[t + 1] += p->first[t];
    for (size_t i = from->n_node; i-- > 0;) {
        const sdm_bvh_node *n = &from->node[i];
        if (!n->count) p->in_node[i] = p->in_node[n->first] + p->in_node[n->first + 1];
        for (uint32_t k = n->first; k < n->first + n->count; k++)
            p->in_node[i] += p->first[from->order[k] + 1] - p->first[from->order[k]];
    }
}

/* The part of the tree below node `from`; its pieces come behind the first n of the order. */
static void derive_part(builder *w, const pieces *p, uint32_t index, uint32_t from, size_t n,
                        int depth)
{
    const sdm_bvh_node *node = &p->from->node[from];
    // a node with pieces on one side only is that side
    while (!node->count && (!p->in_node[node->first] || !p->in_node[node->first + 1]))
        node = &p->from->node[node->first + !p->in_node[node->first]];
    if (!node->count) {
        const uint32_t child = (uint32_t)w->n_part, left = node->first;
        w->n_part += 2;
        w->part[index] = (part){child, 0};
        derive_part(w, p, child, left, n, depth + 1);
        derive_part(w, p, child + 1, left + 1, n + p->in_node[left], depth + 1);
        return;
    }
    size_t end = n;
    for (uint32_t k = node->first; k < node->first + node->count; k++) {
        const uint32_t t = p->from->order[k];
        for (uint32_t i = p->first[t]; i < p->first[t + 1]; i++) w->item[end++].tri = i;
    }
    for (size_t i = n; i < end && end - n > LEAF; i++)
        w->item[i] = item_of(p->mesh, &p->units, w->item[i].tri);
    build_part(w, index, n, end - n, depth);
}

sdm_status sdm_bvh_derive(const sdm_bvh *from, const sdm_mesh *m, const uint32_t *source,
                          sdm_arena *arena, sdm_bvh *b, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    builder w = {0};
    pieces p = {.from = from, .mesh = m, .units = units_of(from->node->lo, from->node->hi)};
    sdm_status s = start(&w, m->n_tri, arena, b, err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &p.first, from->n_tri + 1, "tree", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &p.in_node, from->n_node, "tree", err);
    if (!s) {
        count_pieces(&p, source);
        derive_part(&w, &p, 0, 0, 0, 0);
        s = finish(m, &w, arena, b, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
