/* Collapses the binary tree over the clusters to one with up to eight children per node. */
#include "wide_tree.h"

#include <math.h>

#include "sdm/internal/heap.h"

/* Half the surface area of the box of a node: how likely a search looks into it. */
static float area_of(const sdm_cluster_node *n)
{
    const float x = n->hi[0] - n->lo[0], y = n->hi[1] - n->lo[1], z = n->hi[2] - n->lo[2];
    return x * y + y * z + z * x;
}

/* child[8] = nodes below `root` that together hold all of its clusters: the largest inner node is
   replaced by its two children until there are eight. Returns their number. */
static int children_choose(const sdm_features *f, uint32_t root, uint32_t child[8])
{
    int n = 0;
    child[n++] = root;
    while (n < 8) {
        int largest = -1;
        for (int i = 0; i < n; i++) {
            const sdm_cluster_node *node = &f->node[child[i]];
            if (node->count) continue;
            if (largest < 0 || area_of(node) > area_of(&f->node[child[largest]])) largest = i;
        }
        if (largest < 0) break;
        const uint32_t first = f->node[child[largest]].first;
        child[largest] = first;
        child[n++] = first + 1;
    }
    return n;
}

size_t sdm_wide_tree_size(const sdm_features *f)
{
    // nodes have at least two children, if there are two clusters: fewer nodes than clusters
    uint32_t stack[SDM_BVH_DEPTH];
    size_t n = 0;
    int top = 0;
    stack[top++] = 0;
    while (top) {
        const sdm_cluster_node *node = &f->node[stack[--top]];
        n += node->count > 0;
        if (node->count) continue;
        stack[top++] = node->first;
        stack[top++] = node->first + 1;
    }
    return n;
}

sdm_status sdm_wide_tree_build(const sdm_features *f, sdm_wide_node **out, sdm_error *err)
{
    sdm_wide_node *tree;
    const sdm_status s = sdm_alloc_unset((void **)&tree, sdm_wide_tree_size(f), sizeof *tree,
                                         "tree of clusters", err);
    *out = tree;
    if (s) return s;
    // the binary node from which each wide node is made, until the loop reaches it, is in child[0]
    uint32_t n = 1;
    tree[0].child[0] = 0;
    for (uint32_t i = 0; i < n; i++) {
        sdm_wide_node *wide = &tree[i];
        uint32_t child[8];
        const int n_child = children_choose(f, wide->child[0], child);
        for (int k = 0; k < 8; k++) {
            const sdm_cluster_node *node = k < n_child ? &f->node[child[k]] : NULL;
            for (int a = 0; a < 3; a++) {
                wide->lo[a][k] = node ? node->lo[a] : INFINITY;
                wide->hi[a][k] = node ? node->hi[a] : -INFINITY;
            }
            wide->child[k] = SDM_WIDE_CLUSTER;
            if (!node) continue;
            wide->child[k] = node->count ? SDM_WIDE_CLUSTER | child[k] : n;
            if (!node->count) tree[n++].child[0] = child[k];
        }
    }
    return SDM_OK;
}
