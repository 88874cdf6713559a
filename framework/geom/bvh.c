/* Bounding volume hierarchy, built by halving space: a node is split in the middle of the longest side of the box of the
   middles of its triangles' boxes. On surface meshes queries are as fast as with the surface area heuristic, and the build is
   several times faster. */
#include "bvh.h"

#include <math.h>
#include <string.h>

#define LEAF 4u
#define FULL ((size_t)8) // small nodes are cut where they leave as many: clusters of the map are full then
#define MIDDLE_DEPTH 64  // below it nodes are halved in their order: bounds the depth of the tree

/* Middles are in units of the mesh's size: they only choose the splits, float is enough. */
typedef struct item {
    float middle[3];
    uint32_t tri;
} item;

typedef struct part {
    uint32_t first, count; // as in sdm_bvh_node
} part;

typedef struct builder {
    item *item, *spare;
    part *part;
    size_t n_part;
} builder;

/* As near to `left` as a multiple of FULL can be, in the order along an axis. */
static size_t cut_to_full(item *list, size_t n, int axis, size_t left)
{
    for (size_t i = 1; i < n; i++) {
        const item x = list[i];
        size_t k = i;
        for (; k > 0 && list[k - 1].middle[axis] > x.middle[axis]; k--) list[k] = list[k - 1];
        list[k] = x;
    }
    const size_t full = (left + FULL / 2) / FULL * FULL;
    return full < FULL ? FULL : full < n ? full : full - FULL;
}

/* Reorders list[n] into two parts and returns the size of the first, 0 < size < n. */
static size_t split(const builder *w, item *list, size_t n, int depth)
{
    if (depth >= MIDDLE_DEPTH) return n / 2;
    float lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < n; i++) {
        for (int a = 0; a < 3; a++) {
            const float x = list[i].middle[a];
            lo[a] = x < lo[a] ? x : lo[a];
            hi[a] = x > hi[a] ? x : hi[a];
        }
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
    if (n > FULL && n <= 4 * FULL) return cut_to_full(list, n, axis, left);
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

static void fill_items(const sdm_mesh *m, item *list)
{
    double lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < 3 * m->n_tri; i++) {
        const double *v = &m->vert[3 * (size_t)m->tri[i]];
        for (int a = 0; a < 3; a++) {
            lo[a] = v[a] < lo[a] ? v[a] : lo[a];
            hi[a] = v[a] > hi[a] ? v[a] : hi[a];
        }
    }
    double size = 0;
    for (int a = 0; a < 3; a++) size = fmax(size, hi[a] - lo[a]);
    const double scale = size > 0 && 1 / size < INFINITY ? 1 / size : 0;
    for (size_t t = 0; t < m->n_tri; t++) {
        const double *v[3] = {corner(m, t, 0), corner(m, t, 1), corner(m, t, 2)};
        for (int a = 0; a < 3; a++) {
            const double low = v[0][a] < v[1][a] ? v[0][a] : v[1][a], high = v[0][a] < v[1][a] ? v[1][a] : v[0][a];
            const double from = v[2][a] < low ? v[2][a] : low, to = v[2][a] > high ? v[2][a] : high;
            list[t].middle[a] = (float)(((from - lo[a]) + (to - lo[a])) * scale);
        }
        list[t].tri = (uint32_t)t;
    }
}

static inline void join(double lo[3], double hi[3], const double other_lo[3], const double other_hi[3])
{
    for (int a = 0; a < 3; a++) {
        lo[a] = other_lo[a] < lo[a] ? other_lo[a] : lo[a];
        hi[a] = other_hi[a] > hi[a] ? other_hi[a] : hi[a];
    }
}

/* Boxes from the leaves up: children come after their parent. */
static void fill_nodes(const sdm_mesh *m, const builder *w, sdm_bvh *b)
{
    for (size_t i = 0; i < b->n_tri; i++) b->order[i] = w->item[i].tri;
    for (size_t i = b->n_node; i-- > 0;) {
        const part p = w->part[i];
        sdm_bvh_node n = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}, p.first, p.count};
        for (uint32_t c = p.first; !p.count && c < p.first + 2; c++) join(n.lo, n.hi, b->node[c].lo, b->node[c].hi);
        for (uint32_t k = p.first; k < p.first + p.count; k++) {
            for (size_t c = 0; c < 3; c++) {
                const double *v = corner(m, b->order[k], c);
                join(n.lo, n.hi, v, v);
            }
        }
        b->node[i] = n;
    }
}

size_t sdm_bvh_bytes(size_t n_tri, size_t *scratch)
{
    *scratch += n_tri * 2 * (sizeof(item) + sizeof(part));
    return n_tri * (2 * sizeof(sdm_bvh_node) + sizeof(uint32_t));
}

sdm_status sdm_bvh_build(const sdm_mesh *m, sdm_arena *arena, sdm_bvh *b, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    builder w = {0};
    b->n_tri = m->n_tri;
    sdm_status s = SDM_TAKE(arena, SDM_HIGH, &w.item, m->n_tri, "tree", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &w.spare, m->n_tri, "tree", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &w.part, 2 * m->n_tri, "tree", err);
    if (!s) s = SDM_TAKE(arena, SDM_LOW, &b->order, m->n_tri, "tree", err);
    if (s) goto done;
    fill_items(m, w.item);
    w.n_part = 1;
    build_part(&w, 0, 0, m->n_tri, 0);
    b->n_node = w.n_part;
    s = SDM_TAKE(arena, SDM_LOW, &b->node, b->n_node, "tree", err);
    if (!s) fill_nodes(m, &w, b);
done:
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
