/* Finds overlapping boxes by a hierarchy with eight children per node: blocks of up to eight
 * triangles in the order of the tree, then nodes of eight blocks, nodes of eight such nodes, and so
 * on. Boxes are floats in units of the mesh's size, rounded outwards. */
#include "pairs.h"

#include <math.h>
#include <string.h>

#include "memory/cancel.h"
#include "simd/boxes.h"

#define OUTWARDS 0x1p-22f // margin of a box: more than twice the rounding error of a float <= 1
#define LEVELS_MAX 11     // 8^11 >= 2^32 blocks

/* Up to eight triangles of one node of the tree. The box of an unused lane is empty and overlaps
 * nothing. */
typedef struct block {
    sdm_box8 box;
    uint32_t tri[8], corner[8][3]; // corners are welded vertices
    uint32_t count;
} block;

typedef struct pairing {
    block *blocks;
    // Lane c of level[0][i] is the box of block 8 i + c; lane c of level[k][i] is the box of
    // all lanes of level[k - 1][8 i + c].
    sdm_box8 *level[LEVELS_MAX];
    size_t n_block;
    int n_level;
    uint8_t *has; // [n_vert] bit k: the vertex is a corner of triangle k of the current block
    sdm_status (*visit)(void *user, uint32_t i, uint32_t j);
    void *user;
} pairing;

static inline uint8_t *has_corner(const pairing *w, const block *b, size_t lane, int c)
{
    return &w->has[b->corner[lane][c]];
}

/* Visits the pairs of a triangle of block i (the current block) and a triangle of block j >= i. */
static sdm_status pairs_of_blocks(const pairing *w, size_t i, size_t j)
{
    const block *a = &w->blocks[i], *b = &w->blocks[j];
    unsigned lanes =
        i == j ? (1u << b->count) - 1 : box8_overlap(&b->box, &w->level[0][i / 8], i % 8);
    for (; lanes; lanes &= lanes - 1) {
        const size_t l = (size_t)__builtin_ctz(lanes);
        const unsigned shared =
            *has_corner(w, b, l, 0) | *has_corner(w, b, l, 1) | *has_corner(w, b, l, 2);
        unsigned mask = box8_overlap(&a->box, &b->box, l) & ~shared;
        if (i == j) mask &= (1u << l) - 1; // each pair only once
        for (; mask; mask &= mask - 1) {
            const sdm_status s = w->visit(w->user, a->tri[__builtin_ctz(mask)], b->tri[l]);
            if (s) return s;
        }
    }
    return SDM_OK;
}

/* Visits the pairs of a triangle of block i and a triangle of block i or of a later block. */
static sdm_status pairs_of_block(const pairing *w, size_t i)
{
    struct {
        size_t at;
        int level;
    } stack[8 * LEVELS_MAX];
    const block *b = &w->blocks[i];
    sdm_status s = SDM_OK;
    for (size_t l = 0; l < b->count; l++)
        for (int c = 0; c < 3; c++) *has_corner(w, b, l, c) |= (uint8_t)(1u << l);
    // traverse the levels from the root; elements before block i are masked out
    int top = 0;
    stack[top].at = 0;
    stack[top++].level = w->n_level - 1;
    while (top && !s) {
        const size_t at = stack[--top].at;
        const int level = stack[top].level;
        if (level < 0) {
            s = pairs_of_blocks(w, i, at);
            continue;
        }
        unsigned mask = box8_overlap(&w->level[level][at], &w->level[0][i / 8], i % 8);
        const size_t first = i >> 3 * level;
        if (8 * at < first) mask &= 255u << (first - 8 * at);
        // push in descending order, so that they are popped in ascending order
        while (mask) {
            const unsigned lane = 31u - (unsigned)__builtin_clz(mask);
            mask ^= 1u << lane;
            stack[top].at = 8 * at + lane;
            stack[top++].level = level - 1;
        }
    }
    for (size_t l = 0; l < b->count; l++)
        for (int c = 0; c < 3; c++) *has_corner(w, b, l, c) = 0;
    return s;
}

/* Conversion of boxes to floats: (x - origin) * scale, enlarged by the margin on each side. */
typedef struct scaling {
    double origin[3], scale;
    float margin;
} scaling;

static scaling scaling_of(const sdm_bvh_node *root, double slack)
{
    double size = 0;
    for (int a = 0; a < 3; a++) size = fmax(size, root->hi[a] - root->lo[a]);
    scaling r = {.scale = size > 0 && 1 / size < INFINITY ? 1 / size : 0};
    memcpy(r.origin, root->lo, sizeof r.origin);
    // Scaled coordinates are in 0 .. 1, so a margin of 1 makes all boxes overlap. A larger margin
    // could become infinite, and then boxes would overlap the empty boxes of unused lanes.
    r.margin = (float)fmin(slack * r.scale, 1) + OUTWARDS;
    return r;
}

/* Sets lane `lane` to the box lo .. hi in mm; lane_clear() makes it empty. */
static void lane_set(sdm_box8 *box, size_t lane, const scaling *r, const double lo[3],
                     const double hi[3])
{
    for (int a = 0; a < 3; a++) {
        box->lo[a][lane] = (float)((lo[a] - r->origin[a]) * r->scale) - r->margin;
        box->hi[a][lane] = (float)((hi[a] - r->origin[a]) * r->scale) + r->margin;
    }
}

static void lane_clear(sdm_box8 *box, size_t lane)
{
    for (int a = 0; a < 3; a++) {
        box->lo[a][lane] = INFINITY;
        box->hi[a][lane] = -INFINITY;
    }
}

static void fill_block(const sdm_mesh *m, const sdm_topology *topo, const uint32_t *order,
                       uint32_t count, const scaling *r, block *b)
{
    b->count = count;
    for (size_t k = count; k < 8; k++) lane_clear(&b->box, k);
    for (size_t k = 0; k < count; k++) {
        const size_t t = b->tri[k] = order[k];
        double lo[3], hi[3];
        for (size_t c = 0; c < 3; c++) {
            const double *x = &m->vert[3 * (size_t)m->tri[3 * t + c]];
            b->corner[k][c] = topo->tri[3 * t + c];
            for (int a = 0; a < 3; a++) {
                lo[a] = c == 0 || x[a] < lo[a] ? x[a] : lo[a];
                hi[a] = c == 0 || x[a] > hi[a] ? x[a] : hi[a];
            }
        }
        lane_set(&b->box, k, r, lo, hi);
    }
}

/* Number of triangles below node n if they become one block: n is a leaf, or has two leaves with at
 * most 8 triangles as children. Else 0. */
static uint32_t block_size(const sdm_bvh_node *node, const sdm_bvh_node *n)
{
    if (n->count) return n->count;
    const sdm_bvh_node *c = &node[n->first];
    return c[0].count && c[1].count && c[0].count + c[1].count <= 8 ? c[0].count + c[1].count : 0;
}

/* Fills the blocks in the order of the tree, and level 0. */
static void fill_blocks(pairing *w, const sdm_mesh *m, const sdm_topology *topo,
                        const sdm_bvh *tree, double slack)
{
    const scaling r = scaling_of(tree->node, slack);
    uint32_t stack[SDM_BVH_DEPTH];
    int top = 0;
    stack[top++] = 0;
    while (top) {
        const sdm_bvh_node *n = &tree->node[stack[--top]];
        const uint32_t count = block_size(tree->node, n);
        if (!count) {
            stack[top++] = n->first + 1;
            stack[top++] = n->first;
            continue;
        }
        const uint32_t first = n->count ? n->first : tree->node[n->first].first;
        fill_block(m, topo, tree->order + first, count, &r, &w->blocks[w->n_block]);
        lane_set(&w->level[0][w->n_block / 8], w->n_block % 8, &r, n->lo, n->hi);
        w->n_block++;
    }
}

/* Level k has the boxes of n elements: clears the unused lanes of level k and fills level k + 1. */
static void fill_level(const pairing *w, int k, size_t n)
{
    for (; n % 8; n++) lane_clear(&w->level[k][n / 8], n % 8);
    for (size_t i = 0; i < n / 8 && k + 1 < w->n_level; i++) {
        const sdm_box8 *from = &w->level[k][i];
        sdm_box8 *to = &w->level[k + 1][i / 8];
        lane_clear(to, i % 8);
        for (int a = 0; a < 3; a++) {
            for (int l = 0; l < 8; l++) {
                to->lo[a][i % 8] = fminf(to->lo[a][i % 8], from->lo[a][l]);
                to->hi[a][i % 8] = fmaxf(to->hi[a][i % 8], from->hi[a][l]);
            }
        }
    }
}

sdm_status sdm_pairs_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                           double slack, sdm_arena *arena,
                           sdm_status (*visit)(void *user, uint32_t i, uint32_t j), void *user,
                           sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    pairing w = {.visit = visit, .user = user};
    size_t n = (tree->n_node + 1) / 2; // number of leaves of the tree; there are not more blocks
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.blocks, n, "pairs of triangles", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &w.has, m->n_vert, "pairs of triangles", err);
    do {
        n = (n + 7) / 8;
        if (!s)
            s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.level[w.n_level], n, "pairs of triangles", err);
        w.n_level++;
    } while (!s && n > 1);
    if (!s) {
        fill_blocks(&w, m, topo, tree, slack);
        n = w.n_block;
        for (int k = 0; k < w.n_level; k++, n = (n + 7) / 8) fill_level(&w, k, n);
    }
    for (size_t i = 0; i < w.n_block && !s; i++) {
        s = sdm_cancel_check(arena->opts, err);
        if (!s) s = pairs_of_block(&w, i);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
