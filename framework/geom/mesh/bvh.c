/* Builds the bounding volume hierarchy by spatial median splits. The centre of a triangle is here
 * the centre of its bounding box; a node is split at the middle of the longest side of the bounding
 * box of its triangles' centres. On surface meshes queries are as fast as with the surface area
 * heuristic, and the build is several times faster. */
#include "bvh.h"

#include <math.h>
#include <string.h>

#include "simd/lanes_two.h"

// A leaf has at most this many triangles.
#define LEAF_MAX 4u
// FULL: number of triangles in a full cluster of the map (see features/). Nodes of at most SORT_MAX
// triangles are split at a multiple of FULL, so that the clusters are full.
#define FULL ((size_t)8)
#define SORT_MAX ((size_t)32)
// Below this depth nodes are split by count, not by space, which bounds the depth of the tree.
#define SPATIAL_DEPTH_MAX 64

/* A triangle to be sorted into the tree. Its centre, doubled and in units of the mesh's size, only
 * selects the split, so float is precise enough. */
typedef struct item {
    float centre[3];
    uint32_t tri;
} item;

typedef int32_t i32x4 __attribute__((vector_size(16)));
typedef float f32x4 __attribute__((vector_size(16)));

/* A node before its box is known; members as in sdm_bvh_node. */
typedef struct bare_node {
    uint32_t first, count;
} bare_node;

/* Scratch memory of a build: items in the order of the tree, a buffer for partitioning them, and
 * the nodes. */
typedef struct builder {
    item *item, *spare;
    bare_node *node;
    size_t n_node;
} builder;

/* Rank sort of list[n], n <= SORT_MAX, along an axis: the new index of an item is the number of
 * items with a smaller key. No branch depends on the keys. */
static void items_sort(item *list, size_t n, int axis)
{
    i32x4 key[SORT_MAX / 4];
    item copy[SORT_MAX];
    memcpy(copy, list, n * sizeof *list);
    // Floats >= 0 compare like their bits as integers. The last five bits become the index, so that
    // all keys differ.
    for (size_t i = 0; i < n; i++) {
        uint32_t bits;
        memcpy(&bits, &list[i].centre[axis], sizeof bits);
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

/* Sorts list[n] along an axis and returns the multiple of FULL nearest to `left` that leaves both
 * sides non-empty. */
static size_t split_at_full(item *list, size_t n, int axis, size_t left)
{
    items_sort(list, n, axis);
    const size_t full = (left + FULL / 2) / FULL * FULL;
    return full < FULL ? FULL : full < n ? full : full - FULL;
}

/* The centre in lanes 0 to 2; lane 3 (the bits of the index) has no meaning. */
static inline f32x4 item_lanes(const item *x)
{
    f32x4 bits;
    memcpy(&bits, x, sizeof bits);
    return bits;
}

/* Per lane: x where a < b, else y. */
static inline f32x4 select_less(f32x4 a, f32x4 b, f32x4 x, f32x4 y)
{
    const i32x4 m = a < b;
    return (f32x4)((m & (i32x4)x) | (~m & (i32x4)y));
}

/* Partitions list[n] for the two children of a node and returns the size of the first part, 0 <
 * size < n. */
static size_t items_split(const builder *w, item *list, size_t n, int depth)
{
    if (n <= FULL || depth >= SPATIAL_DEPTH_MAX) return n / 2;
    // longest side of the bounding box of the centres, and its middle
    f32x4 lo = item_lanes(list), hi = lo;
    for (size_t i = 1; i < n; i++) {
        const f32x4 x = item_lanes(&list[i]);
        lo = select_less(x, lo, x, lo);
        hi = select_less(hi, x, x, hi);
    }
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (hi[a] - lo[a] > hi[axis] - lo[axis]) axis = a;
    const float at = 0.5f * (lo[axis] + hi[axis]);
    // partition without branches, which would be mispredicted every second time
    size_t left = 0, right = 0;
    for (size_t i = 0; i < n; i++) {
        const item it = list[i];
        const size_t is_left = it.centre[axis] < at;
        list[left] = it;
        w->spare[right] = it;
        left += is_left;
        right += !is_left;
    }
    memcpy(list + left, w->spare, right * sizeof *list);
    if (n <= SORT_MAX) return split_at_full(list, n, axis, left);
    // one side is empty when all centres coincide
    return left > 0 && left < n ? left : n / 2;
}

/* Builds the subtree of item[first .. first + n) with its root at node[index]. */
static void build_node(builder *w, uint32_t index, size_t first, size_t n, int depth)
{
    if (n <= LEAF_MAX) {
        w->node[index] = (bare_node){(uint32_t)first, (uint32_t)n};
        return;
    }
    const size_t left = items_split(w, w->item + first, n, depth);
    const uint32_t child = (uint32_t)w->n_node;
    w->n_node += 2;
    w->node[index] = (bare_node){child, 0};
    build_node(w, child, first, left, depth + 1);
    build_node(w, child + 1, first + left, n - left, depth + 1);
}

static inline const double *corner(const sdm_mesh *m, size_t t, size_t k)
{
    return &m->vert[3 * (size_t)m->tri[3 * t + k]];
}

/* Map from mm to the coordinates of centres: (x - origin) * scale. */
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
        it.centre[a] = (float)(((from - u->origin[a]) + (to - u->origin[a])) * u->scale);
    }
    return it;
}

/* An axis-aligned box; x and y are the two lanes of lo and hi. */
typedef struct box {
    v2d lo, hi;
    double lo_z, hi_z;
} box;

/* Enlarges b by the box lo .. hi. */
static inline void box_join(box *b, const double lo[3], const double hi[3])
{
    b->lo = d2_lesser(d2_load(lo), b->lo);
    b->hi = d2_greater(d2_load(hi), b->hi);
    b->lo_z = lo[2] < b->lo_z ? lo[2] : b->lo_z;
    b->hi_z = hi[2] > b->hi_z ? hi[2] : b->hi_z;
}

/* Fills the nodes from the last to the first: children have larger indices than their parent, so
 * their boxes are known. */
static void fill_nodes(const sdm_mesh *m, const builder *w, sdm_bvh *b)
{
    for (size_t i = 0; i < b->n_tri; i++) b->order[i] = w->item[i].tri;
    for (size_t i = b->n_node; i-- > 0;) {
        const bare_node p = w->node[i];
        box x = {d2_all(INFINITY), d2_all(-INFINITY), INFINITY, -INFINITY};
        for (uint32_t c = p.first; !p.count && c < p.first + 2; c++)
            box_join(&x, b->node[c].lo, b->node[c].hi);
        for (uint32_t k = p.first; k < p.first + p.count; k++)
            for (size_t c = 0; c < 3; c++)
                box_join(&x, corner(m, b->order[k], c), corner(m, b->order[k], c));
        b->node[i] = (sdm_bvh_node){
            {x.lo[0], x.lo[1], x.lo_z}, {x.hi[0], x.hi[1], x.hi_z}, p.first, p.count};
    }
}

static sdm_status builder_start(builder *w, size_t n_tri, sdm_arena *arena, sdm_bvh *b,
                                sdm_error *err)
{
    b->n_tri = n_tri;
    w->n_node = 1;
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w->item, n_tri, "tree", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w->spare, n_tri, "tree", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w->node, 2 * n_tri, "tree", err);
    return s ? s : SDM_TAKE_UNSET(arena, SDM_LOW, &b->order, n_tri, "tree", err);
}

static sdm_status builder_finish(const sdm_mesh *m, const builder *w, sdm_arena *arena, sdm_bvh *b,
                                 sdm_error *err)
{
    b->n_node = w->n_node;
    const sdm_status s = SDM_TAKE_UNSET(arena, SDM_LOW, &b->node, b->n_node, "tree", err);
    if (!s) fill_nodes(m, w, b);
    return s;
}

sdm_status sdm_bvh_build(const sdm_mesh *m, sdm_arena *arena, sdm_bvh *b, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    builder w = {0};
    sdm_status s = builder_start(&w, m->n_tri, arena, b, err);
    if (!s) {
        box x = {d2_all(INFINITY), d2_all(-INFINITY), INFINITY, -INFINITY};
        for (size_t t = 0; t < m->n_tri; t++)
            for (size_t c = 0; c < 3; c++) box_join(&x, corner(m, t, c), corner(m, t, c));
        const units u =
            units_of((double[3]){x.lo[0], x.lo[1], x.lo_z}, (double[3]){x.hi[0], x.hi[1], x.hi_z});
        for (size_t t = 0; t < m->n_tri; t++) w.item[t] = item_of(m, &u, t);
        build_node(&w, 0, 0, m->n_tri, 0);
        s = builder_finish(m, &w, arena, b, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}

/* A mesh whose triangles ("pieces") are parts of the triangles of another mesh, the source. */
typedef struct pieces {
    const sdm_bvh *from; // tree of the source mesh
    const sdm_mesh *mesh;
    units units;
    // [n_tri + 1] the pieces of source triangle t are first[t] .. first[t + 1] - 1
    uint32_t *first;
    // [n_node] number of pieces below a node of `from`
    uint32_t *in_node;
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

/* Copies the subtree of node `from` of the source tree to node[index] and splits its leaves
 * further; the pieces below it become item[n], item[n + 1] ... */
static void derive_node(builder *w, const pieces *p, uint32_t index, uint32_t from, size_t n,
                        int depth)
{
    const sdm_bvh_node *node = &p->from->node[from];
    // a node with an empty child is replaced by its other child
    while (!node->count && (!p->in_node[node->first] || !p->in_node[node->first + 1]))
        node = &p->from->node[node->first + !p->in_node[node->first]];
    if (!node->count) {
        const uint32_t child = (uint32_t)w->n_node, left = node->first;
        w->n_node += 2;
        w->node[index] = (bare_node){child, 0};
        derive_node(w, p, child, left, n, depth + 1);
        derive_node(w, p, child + 1, left + 1, n + p->in_node[left], depth + 1);
        return;
    }
    // a leaf: list its pieces, and split them if they are too many
    size_t end = n;
    for (uint32_t k = node->first; k < node->first + node->count; k++) {
        const uint32_t t = p->from->order[k];
        for (uint32_t i = p->first[t]; i < p->first[t + 1]; i++) w->item[end++].tri = i;
    }
    for (size_t i = n; i < end && end - n > LEAF_MAX; i++)
        w->item[i] = item_of(p->mesh, &p->units, w->item[i].tri);
    build_node(w, index, n, end - n, depth);
}

sdm_status sdm_bvh_derive(const sdm_bvh *from, const sdm_mesh *m, const uint32_t *source,
                          sdm_arena *arena, sdm_bvh *b, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    builder w = {0};
    pieces p = {.from = from, .mesh = m, .units = units_of(from->node->lo, from->node->hi)};
    sdm_status s = builder_start(&w, m->n_tri, arena, b, err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &p.first, from->n_tri + 1, "tree", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &p.in_node, from->n_node, "tree", err);
    if (!s) {
        count_pieces(&p, source);
        derive_node(&w, &p, 0, 0, 0, 0);
        s = builder_finish(m, &w, arena, b, err);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
