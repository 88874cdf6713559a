/* Pairs of triangles by walking a tree against itself. Boxes are floats in units of the mesh's size, rounded outwards. */
#include "pairs.h"

#include <math.h>
#include <string.h>

#include "pair_kernel.h"

#define OUTWARDS 0x1p-22f // twice the rounding of a number between 0 and 1, and then some

/* The triangles of a leaf; lanes without a triangle overlap nothing. */
typedef struct leaf {
    sdm_box4 box;
    uint32_t vertex[3][4], tri[4];
} leaf;

/* A node: for an inner one the boxes of its children in lanes 0 1 0 1 and in lanes 0 0 1 1. */
typedef struct node {
    sdm_box4 alternating, doubled;
} node;

typedef struct pairing {
    const sdm_bvh_node *tree;
    const uint32_t *place; // [node] in leaves or nodes
    leaf *leaves;
    node *nodes;
    sdm_status (*visit)(void *user, uint32_t i, uint32_t j);
    void *user;
} pairing;

static sdm_status visit_lanes(const pairing *w, uint32_t tri, const leaf *b, int mask)
{
    for (int l = 0; mask >> l; l++) {
        if (!(mask >> l & 1)) continue;
        const sdm_status s = w->visit(w->user, tri, b->tri[l]);
        if (s) return s;
    }
    return SDM_OK;
}

static sdm_status pairs_of_leaves(const pairing *w, uint32_t i, uint32_t j)
{
    const leaf *a = &w->leaves[w->place[i]], *b = &w->leaves[w->place[j]];
    const int n = (int)w->tree[i].count;
    int mask[4], any = 0;
    for (int k = 0; k < n; k++) {
        mask[k] = box4_overlap_one(&a->box, k, &b->box) & ~vertex4_shared_one(a->vertex, k, b->vertex);
        if (a == b) mask[k] &= 14 << k; // each pair once
        any |= mask[k];
    }
    sdm_status s = SDM_OK;
    for (int k = 0; any && k < n && !s; k++) s = visit_lanes(w, a->tri[k], b, mask[k]);
    return s;
}

/* Nodes whose boxes overlap; i == j: the pairs within a node. */
typedef struct node_pair {
    uint32_t i, j;
} node_pair;

/* A pair waits with at most three others of each of the levels above it. */
#define STACK (3 * 2 * SDM_BVH_DEPTH + 4)

/* Opens a pair that is not of two leaves; returns the new top. Without branches on what overlaps: it cannot be foreseen. */
static int open_pair(const pairing *w, node_pair p, node_pair *stack, int top)
{
    const sdm_bvh_node *a = &w->tree[p.i], *b = &w->tree[p.j];
    if (p.i == p.j) {
        const node *n = &w->nodes[w->place[p.i]];
        stack[top] = (node_pair){a->first, a->first + 1};
        top += box4_overlap(&n->doubled, &n->alternating) >> 1 & 1;
        stack[top++] = (node_pair){a->first + 1, a->first + 1};
        stack[top++] = (node_pair){a->first, a->first};
    } else if (!a->count && !b->count) {
        const int mask = box4_overlap(&w->nodes[w->place[p.i]].doubled, &w->nodes[w->place[p.j]].alternating);
        for (uint32_t l = 0; l < 4; l++) {
            stack[top] = (node_pair){a->first + l / 2, b->first + l % 2};
            top += mask >> l & 1;
        }
    } else {
        // the leaf's triangles against the children of the other
        const uint32_t flat = a->count ? p.i : p.j, inner = a->count ? p.j : p.i;
        const leaf *f = &w->leaves[w->place[flat]];
        const sdm_box4 *children = &w->nodes[w->place[inner]].alternating;
        const int mask = box4_overlap_one(&f->box, 0, children) | box4_overlap_one(&f->box, 1, children) |
                         box4_overlap_one(&f->box, 2, children) | box4_overlap_one(&f->box, 3, children);
        for (uint32_t l = 0; l < 2; l++) {
            stack[top] = (node_pair){flat, w->tree[inner].first + l};
            top += mask >> l & 1;
        }
    }
    return top;
}

static sdm_status walk(const pairing *w)
{
    node_pair stack[STACK];
    int top = 0;
    stack[top++] = (node_pair){0, 0};
    while (top) {
        const node_pair p = stack[--top];
        if (w->tree[p.i].count && w->tree[p.j].count) {
            const sdm_status s = pairs_of_leaves(w, p.i, p.j);
            if (s) return s;
        } else {
            top = open_pair(w, p, stack, top);
        }
    }
    return SDM_OK;
}

/* From the mesh to boxes in floats. */
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
    r.margin = (float)(slack * r.scale) + OUTWARDS;
    return r;
}

static void set_lane(sdm_box4 *box, int lane, const scaling *r, const double lo[3], const double hi[3])
{
    for (int a = 0; a < 3; a++) {
        box->lo[a][lane] = (float)((lo[a] - r->origin[a]) * r->scale) - r->margin;
        box->hi[a][lane] = (float)((hi[a] - r->origin[a]) * r->scale) + r->margin;
    }
}

static void fill_leaf(const sdm_mesh *m, const sdm_topology *topo, const uint32_t *order, uint32_t count,
                      const scaling *r, leaf *f)
{
    for (int k = (int)count; k < 4; k++) {
        for (int a = 0; a < 3; a++) {
            f->box.lo[a][k] = INFINITY;
            f->box.hi[a][k] = -INFINITY;
            f->vertex[a][k] = 0;
        }
        f->tri[k] = 0;
    }
    for (int k = 0; k < (int)count; k++) {
        const size_t t = f->tri[k] = order[k];
        double lo[3], hi[3];
        for (size_t c = 0; c < 3; c++) {
            const double *x = &m->vert[3 * (size_t)m->tri[3 * t + c]];
            f->vertex[c][k] = topo->tri[3 * t + c];
            for (int a = 0; a < 3; a++) {
                lo[a] = c == 0 || x[a] < lo[a] ? x[a] : lo[a];
                hi[a] = c == 0 || x[a] > hi[a] ? x[a] : hi[a];
            }
        }
        set_lane(&f->box, k, r, lo, hi);
    }
}

static void fill_node(const sdm_bvh_node *child, const scaling *r, node *n)
{
    for (int l = 0; l < 4; l++) {
        set_lane(&n->alternating, l, r, child[l % 2].lo, child[l % 2].hi);
        set_lane(&n->doubled, l, r, child[l / 2].lo, child[l / 2].hi);
    }
}

size_t sdm_pairs_bytes(const sdm_bvh *tree)
{
    return tree->n_node * sizeof(uint32_t) + (tree->n_node + 1) / 2 * (sizeof(leaf) + sizeof(node));
}

sdm_status sdm_pairs_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree, double slack,
                           sdm_arena *arena, sdm_status (*visit)(void *user, uint32_t i, uint32_t j), void *user,
                           sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    pairing w = {.tree = tree->node, .visit = visit, .user = user};
    uint32_t *place;
    const size_t n_leaf = (tree->n_node + 1) / 2;
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &place, tree->n_node, "pairs of triangles", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.leaves, n_leaf, "pairs of triangles", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.nodes, n_leaf, "pairs of triangles", err);
    if (!s) {
        const scaling r = scaling_of(tree->node, slack);
        uint32_t leaves = 0, nodes = 0;
        for (size_t i = 0; i < tree->n_node; i++) {
            const sdm_bvh_node *n = &tree->node[i];
            place[i] = n->count ? leaves++ : nodes++;
            if (n->count)
                fill_leaf(m, topo, tree->order + n->first, n->count, &r, &w.leaves[place[i]]);
            else
                fill_node(&tree->node[n->first], &r, &w.nodes[place[i]]);
        }
        w.place = place;
        s = walk(&w);
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
