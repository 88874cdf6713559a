/* Walks of the tree of wide_tree.h from near to far. */
#pragma once

#include "simd/lanes.h"
#include "wide_tree.h"

/* A child on the stack of a walk, see sdm_wide_node.child, and the squared distance of its box. */
typedef struct wide_entry {
    uint32_t child;
    float d2;
} wide_entry;

/* Pushes the children of a node whose squared distances, d2[child], are below `limit`, the nearest
   one last. top: number of entries. Returns their new number. */
static inline int wide_push(const sdm_wide_node *node, v8f d2, float limit, wide_entry *stack,
                            int top)
{
    _Alignas(32) float d[8];
    v8_store(d, d2);
    const int base = top;
    for (unsigned near = (unsigned)v8_greater(v8_all(limit), d2); near; near &= near - 1) {
        const unsigned k = (unsigned)__builtin_ctz(near);
        int at = top++;
        for (; at > base && stack[at - 1].d2 < d[k]; at--) stack[at] = stack[at - 1];
        stack[at] = (wide_entry){node->child[k], d[k]};
    }
    return top;
}

/* Squared distances of the children's boxes from the box lo ... hi. */
static inline v8f wide_box_distances2(const sdm_wide_node *node, const float lo[3],
                                      const float hi[3])
{
    const point8 below = p8_sub(p8_load((const float(*)[8])node->lo), p8_all(hi[0], hi[1], hi[2])),
                 above = p8_sub(p8_all(lo[0], lo[1], lo[2]), p8_load((const float(*)[8])node->hi));
    const v8f zero = v8_all(0);
    const point8 away = {v8_max(v8_max(below.x, above.x), zero),
                         v8_max(v8_max(below.y, above.y), zero),
                         v8_max(v8_max(below.z, above.z), zero)};
    return p8_dot(away, away);
}
