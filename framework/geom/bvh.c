/* Bounding volume hierarchy: build by the binned surface area heuristic (Wald 2007), pairs of overlapping boxes. */
#include "bvh.h"

#include <math.h>
#include <string.h>

#include "sdm/memory.h"

#define LEAF 4u
#define BINS 12
#define SMALL 12u    // nodes up to this size are split in the middle of their longest side
#define SAH_DEPTH 64 // below it halves: bounds the depth of the tree

typedef struct builder {
    sdm_bvh *tree;
    double (*box)[6]; // of triangles, mesh order
    double (*mid)[3]; // twice their middles
} builder;

static const double empty_box[6] = {INFINITY, INFINITY, INFINITY, -INFINITY, -INFINITY, -INFINITY};

static inline void join(double box[6], const double other[6])
{
    for (int a = 0; a < 3; a++) {
        box[a] = other[a] < box[a] ? other[a] : box[a];
        box[3 + a] = other[3 + a] > box[3 + a] ? other[3 + a] : box[3 + a];
    }
}

static double half_area(const double box[6])
{
    const double x = box[3] - box[0], y = box[4] - box[1], z = box[5] - box[2];
    return x >= 0 ? x * y + y * z + z * x : 0;
}

static inline int bin_of(double mid, double lo, double scale)
{
    const int bin = (int)((mid - lo) * scale);
    return bin < 0 ? 0 : bin >= BINS ? BINS - 1 : bin;
}

/* Costs of the BINS - 1 planes across one axis; returns the best plane and its cost. */
static int best_plane(const builder *w, const uint32_t *order, size_t n, int axis, double lo, double scale,
                      double *cost)
{
    double box[BINS][6];
    size_t count[BINS] = {0};
    for (int b = 0; b < BINS; b++) memcpy(box[b], empty_box, sizeof box[b]);
    for (size_t i = 0; i < n; i++) {
        const int b = bin_of(w->mid[order[i]][axis], lo, scale);
        count[b]++;
        join(box[b], w->box[order[i]]);
    }
    double right_cost[BINS];
    double sweep[6];
    size_t sum = 0;
    memcpy(sweep, empty_box, sizeof sweep);
    for (int b = BINS - 1; b > 0; b--) {
        join(sweep, box[b]);
        sum += count[b];
        right_cost[b] = half_area(sweep) * (double)sum;
    }
    int best = 0;
    sum = 0;
    memcpy(sweep, empty_box, sizeof sweep);
    for (int b = 1; b < BINS; b++) {
        join(sweep, box[b - 1]);
        sum += count[b - 1];
        const double c = half_area(sweep) * (double)sum + right_cost[b];
        if (sum > 0 && sum < n && c < *cost) {
            *cost = c;
            best = b;
        }
    }
    return best;
}

/* Splits where the middles' box has its middle; mid: that box. */
static size_t split_middle(const builder *w, uint32_t *order, size_t n, const double mid[6])
{
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (mid[3 + a] - mid[a] > mid[3 + axis] - mid[axis]) axis = a;
    const double at = 0.5 * mid[axis] + 0.5 * mid[3 + axis];
    size_t left = 0;
    for (size_t i = 0; i < n; i++) {
        if (!(w->mid[order[i]][axis] < at)) continue;
        const uint32_t t = order[i];
        order[i] = order[left];
        order[left++] = t;
    }
    return left > 0 && left < n ? left : n / 2;
}

/* Reorders order[n] into two parts and returns the size of the first, 0 < size < n. */
static size_t split(const builder *w, uint32_t *order, size_t n, int depth)
{
    double mid[6];
    memcpy(mid, empty_box, sizeof mid);
    for (size_t i = 0; i < n; i++) {
        const double *m = w->mid[order[i]];
        const double point[6] = {m[0], m[1], m[2], m[0], m[1], m[2]};
        join(mid, point);
    }
    if (depth >= SAH_DEPTH) return n / 2;
    if (n <= SMALL) return split_middle(w, order, n, mid);
    double cost = INFINITY, scale = 0;
    int axis = -1, plane = 0;
    for (int a = 0; a < 3; a++) {
        const double extent = mid[3 + a] - mid[a];
        if (!(extent > 0) || !(BINS / extent < INFINITY)) continue;
        const double before = cost;
        const int p = best_plane(w, order, n, a, mid[a], BINS / extent, &cost);
        if (!(cost < before)) continue;
        axis = a;
        plane = p;
        scale = BINS / extent;
    }
    if (axis < 0) return n / 2; // all middles coincide
    size_t left = 0;
    for (size_t i = 0; i < n; i++) {
        if (bin_of(w->mid[order[i]][axis], mid[axis], scale) >= plane) continue;
        const uint32_t t = order[i];
        order[i] = order[left];
        order[left++] = t;
    }
    return left;
}

static void build_node(builder *w, uint32_t index, size_t first, size_t n, int depth)
{
    sdm_bvh *tree = w->tree;
    double box[6];
    memcpy(box, empty_box, sizeof box);
    for (size_t i = first; i < first + n; i++) join(box, w->box[tree->order[i]]);
    sdm_bvh_node *node = &tree->node[index];
    memcpy(node->lo, box, sizeof node->lo);
    memcpy(node->hi, box + 3, sizeof node->hi);
    if (n <= LEAF) {
        node->first = (uint32_t)first;
        node->count = (uint32_t)n;
        return;
    }
    const size_t left = split(w, tree->order + first, n, depth);
    const uint32_t child = (uint32_t)tree->n_node;
    tree->n_node += 2;
    node->first = child;
    node->count = 0;
    build_node(w, child, first, left, depth + 1);
    build_node(w, child + 1, first + left, n - left, depth + 1);
}

sdm_status sdm_bvh_build(const sdm_mesh *m, sdm_bvh *b, sdm_error *err)
{
    builder w = {.tree = b};
    b->n_tri = m->n_tri;
    sdm_status s = SDM_ALLOC(&b->node, 2 * m->n_tri, "tree", err);
    if (!s) s = SDM_ALLOC(&b->order, m->n_tri, "tree", err);
    if (!s) s = SDM_ALLOC(&b->box, m->n_tri, "tree", err);
    if (!s) s = SDM_ALLOC(&w.box, m->n_tri, "tree", err);
    if (!s) s = SDM_ALLOC(&w.mid, m->n_tri, "tree", err);
    if (s) goto done;
    for (size_t t = 0; t < m->n_tri; t++) {
        b->order[t] = (uint32_t)t;
        memcpy(w.box[t], empty_box, sizeof w.box[t]);
        for (int c = 0; c < 3; c++) {
            const double *v = &m->vert[3 * (size_t)m->tri[3 * t + (size_t)c]];
            const double point[6] = {v[0], v[1], v[2], v[0], v[1], v[2]};
            join(w.box[t], point);
        }
        for (int a = 0; a < 3; a++) w.mid[t][a] = w.box[t][a] + w.box[t][3 + a];
    }
    b->n_node = 1;
    build_node(&w, 0, 0, m->n_tri, 0);
    for (size_t i = 0; i < m->n_tri; i++) memcpy(b->box[i], w.box[b->order[i]], sizeof b->box[i]);
done:
    sdm_free(w.box);
    sdm_free(w.mid);
    return s;
}

void sdm_bvh_dispose(sdm_bvh *b)
{
    sdm_free(b->node);
    sdm_free(b->order);
    sdm_free(b->box);
    *b = (sdm_bvh){0};
}

typedef struct pairing {
    const sdm_bvh *tree;
    double slack;
    sdm_status (*visit)(void *user, uint32_t i, uint32_t j);
    void *user;
} pairing;

static inline int apart(const double *alo, const double *ahi, const double *blo, const double *bhi, double slack)
{
    int out = 0;
    for (int i = 0; i < 3; i++) out |= (alo[i] > bhi[i] + slack) | (blo[i] > ahi[i] + slack);
    return out;
}

static sdm_status pairs_of_leaves(const pairing *w, const sdm_bvh_node *a, const sdm_bvh_node *b)
{
    const sdm_bvh *t = w->tree;
    for (uint32_t i = a->first; i < a->first + a->count; i++) {
        for (uint32_t j = a == b ? i + 1 : b->first; j < b->first + b->count; j++) {
            if (apart(t->box[i], t->box[i] + 3, t->box[j], t->box[j] + 3, w->slack)) continue;
            const sdm_status s = w->visit(w->user, t->order[i], t->order[j]);
            if (s) return s;
        }
    }
    return SDM_OK;
}

static sdm_status pairs_between(const pairing *w, const sdm_bvh_node *a, const sdm_bvh_node *b)
{
    if (apart(a->lo, a->hi, b->lo, b->hi, w->slack)) return SDM_OK;
    if (a->count && b->count) return pairs_of_leaves(w, a, b);
    // open the larger node
    const double size_a = (a->hi[0] - a->lo[0]) + (a->hi[1] - a->lo[1]) + (a->hi[2] - a->lo[2]);
    const double size_b = (b->hi[0] - b->lo[0]) + (b->hi[1] - b->lo[1]) + (b->hi[2] - b->lo[2]);
    if (!a->count && (b->count || size_a >= size_b)) {
        const sdm_bvh_node *child = &w->tree->node[a->first];
        const sdm_status s = pairs_between(w, child, b);
        return s ? s : pairs_between(w, child + 1, b);
    }
    const sdm_bvh_node *child = &w->tree->node[b->first];
    const sdm_status s = pairs_between(w, a, child);
    return s ? s : pairs_between(w, a, child + 1);
}

static sdm_status pairs_within(const pairing *w, const sdm_bvh_node *a)
{
    if (a->count) return pairs_of_leaves(w, a, a);
    const sdm_bvh_node *child = &w->tree->node[a->first];
    sdm_status s = pairs_within(w, child);
    if (!s) s = pairs_within(w, child + 1);
    return s ? s : pairs_between(w, child, child + 1);
}

sdm_status sdm_bvh_pairs(const sdm_bvh *b, double slack, sdm_status (*visit)(void *user, uint32_t i, uint32_t j),
                         void *user)
{
    const pairing w = {b, slack, visit, user};
    return pairs_within(&w, b->node);
}
