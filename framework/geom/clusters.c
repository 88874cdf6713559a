/* Clusters of triangles: halves along the longest side, to multiples of eight. */
#include "clusters.h"

#include <math.h>

typedef struct builder {
    float (*mid)[4], (*box)[6];
    uint32_t *order;
    sdm_cluster_node *node;
    size_t n_node;
} builder;

/* Moves those that belong before the nth place along the axis before it (Hoare 1961). */
static void select_nth(float (*mid)[4], uint32_t *order, size_t n, size_t nth, int axis)
{
    size_t lo = 0, hi = n;
    while (hi - lo > 1) {
        const float pivot = mid[order[lo + (hi - lo) / 2]][axis];
        size_t i = lo, j = hi;
        for (;;) {
            while (mid[order[i]][axis] < pivot) i++;
            while (mid[order[j - 1]][axis] > pivot) j--;
            if (i >= j) break;
            const uint32_t t = order[i];
            order[i++] = order[--j];
            order[j] = t;
            if (i >= j) break;
        }
        // up to j at most the pivot, from i on at least
        if (nth < j)
            hi = j;
        else if (nth >= i)
            lo = i;
        else
            return;
    }
}

static void join(sdm_cluster_node *node, const float lo[3], const float hi[3])
{
    for (int a = 0; a < 3; a++) {
        node->lo[a] = lo[a] < node->lo[a] ? lo[a] : node->lo[a];
        node->hi[a] = hi[a] > node->hi[a] ? hi[a] : node->hi[a];
    }
}

static void split(builder *b, size_t first, size_t n)
{
    sdm_cluster_node *node = &b->node[b->n_node++];
    *node = (sdm_cluster_node){.lo = {INFINITY, INFINITY, INFINITY},
                               .hi = {-INFINITY, -INFINITY, -INFINITY},
                               .first = (uint32_t)(first / 8),
                               .n = (uint32_t)((n + 7) / 8)};
    if (n <= 8) {
        for (size_t i = first; i < first + n; i++) join(node, b->box[b->order[i]], b->box[b->order[i]] + 3);
        return;
    }
    sdm_cluster_node middles = *node;
    for (size_t i = first; i < first + n; i++) join(&middles, b->mid[b->order[i]], b->mid[b->order[i]]);
    int axis = 0;
    for (int a = 1; a < 3; a++)
        if (middles.hi[a] - middles.lo[a] > middles.hi[axis] - middles.lo[axis]) axis = a;
    const size_t left = (n / 2 + 7) / 8 * 8;
    select_nth(b->mid, b->order + first, n, left, axis);
    split(b, first, left);
    node->second = (uint32_t)b->n_node;
    split(b, first + left, n - left);
    join(node, node[1].lo, node[1].hi);
    join(node, b->node[node->second].lo, b->node[node->second].hi);
}

size_t sdm_clusters_build(float (*mid)[4], float (*box)[6], uint32_t *order, size_t n, sdm_cluster_node *node)
{
    builder b = {.mid = mid, .box = box, .order = order, .node = node};
    split(&b, 0, n);
    return b.n_node;
}
