/* The order in which the blocks of a pod network are decoded: slab by slab; within a slab first the
   levels above 0, depth first, then the leaves with x fastest, so that whole rows of the map are
   written. Words as in pod_internal.h. */
#include "pod_internal.h"

// the first descendant of block b on the level that is `level` levels lower
static size_t first_leaf(const sdm_pod_block *blocks, size_t b, size_t level)
{
    while (level-- > 0) b = blocks[b].child;
    return b;
}

// Sets leaves[] of a slab, x fastest. The leaves of a slab fill a box that spans the grid along x.
static void order_leaves(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t edge,
                         const pod_slab *s, pod_leaf *leaves)
{
    // number of leaves of the box along x and y
    const sdm_pod_block *first = &blocks[s->leaf];
    size_t nx = 0, ny = 0;
    for (size_t b = s->leaf; b < s->leaf_end; b++) {
        const size_t x = blocks[b].at[0] / edge + 1,
                     y = (blocks[b].at[1] - first->at[1]) / edge + 1;
        if (x > nx) nx = x;
        if (y > ny) ny = y;
    }

    // store each leaf at the index of its position in the box
    for (size_t g = s->group, b = s->leaf; g < s->group_end; g++) {
        const size_t n = levels->n > 1 ? blocks[g].n_children : 1;
        for (size_t end = b + n; b < end; b++) {
            const size_t x = blocks[b].at[0] / edge, y = (blocks[b].at[1] - first->at[1]) / edge,
                         z = (blocks[b].at[2] - first->at[2]) / edge;
            leaves[s->leaf + (z * ny + y) * nx + x] =
                (pod_leaf){.block = (uint32_t)b, .group = (uint32_t)(g - s->group)};
        }
    }
}

size_t sdm_pod_slabs(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t edge,
                     pod_slab *slabs, pod_leaf *leaves)
{
    const size_t top = levels->n - 1, end = levels->first[levels->n], groups = top ? 1 : 0;
    size_t n = 0;
    for (size_t b = levels->first[top]; b < end; n++) {
        pod_slab *s = &slabs[n];
        const sdm_pod_block *first = &blocks[b];
        s->top = (uint32_t)b;
        while (b < end && blocks[b].at[1] == first->at[1] && blocks[b].at[2] == first->at[2]) b++;
        s->top_end = (uint32_t)b;

        // its leaves and groups: descendants of contiguous blocks are contiguous
        s->leaf = (uint32_t)first_leaf(blocks, s->top, top);
        s->leaf_end = (uint32_t)(b < end ? first_leaf(blocks, b, top) : levels->first[1]);
        s->group = (uint32_t)first_leaf(blocks, s->top, top - groups);
        s->group_end =
            (uint32_t)(b < end ? first_leaf(blocks, b, top - groups) : levels->first[groups + 1]);
        const sdm_pod_block *last = &blocks[s->leaf_end - 1];
        s->coefficient = blocks[s->leaf].coefficient;
        s->n_coefficients = last->coefficient + last->rank - s->coefficient;
        order_leaves(levels, blocks, edge, s, leaves);
    }
    return n;
}

size_t sdm_pod_count_weights(sdm_pod_type type, size_t outputs, size_t n_wide, size_t k)
{
    return type == SDM_POD_I8 ? sdm_panel_i8_count(outputs, n_wide, k)
                              : sdm_panel_count(outputs, k);
}

size_t sdm_pod_count_layer(sdm_pod_type type, const sdm_pod_arch *a, size_t layer)
{
    const size_t k = sdm_pod_layer_inputs(a, layer);
    return sdm_pod_count_weights(type, a->width, k, k);
}

size_t sdm_pod_count_mlp(sdm_pod_type type, const sdm_pod_arch *a)
{
    size_t n = 0;
    for (size_t l = 0; l < a->depth; l++) n += sdm_pod_count_layer(type, a, l);
    return n;
}

// State of sdm_pod_place_weights(): its arguments, and the offset of the next block.
typedef struct placement {
    sdm_pod_type type;
    const sdm_pod_block *blocks;
    const uint32_t *wide;
    size_t next, *at;
} placement;

static void block_place(placement *p, size_t b)
{
    p->at[b] = p->next;
    p->next += sdm_pod_count_weights(p->type, sdm_pod_outputs(p->blocks, b),
                                     p->wide ? p->wide[b] : 0, p->blocks[b].rank);
}

// Places block b of `level` and its descendants above level 0, depth first.
static void upper_place(placement *p, size_t b, size_t level)
{
    if (level == 0) return;
    block_place(p, b);
    for (size_t i = 0; i < p->blocks[b].n_children; i++)
        upper_place(p, p->blocks[b].child + i, level - 1);
}

size_t sdm_pod_place_weights(sdm_pod_type type, const sdm_pod_levels *levels,
                             const sdm_pod_block *blocks, const pod_slab *slabs, size_t n_slabs,
                             const pod_leaf *leaves, const uint32_t *wide, size_t *at)
{
    placement p = {type, blocks, wide, 0, at};
    for (const pod_slab *s = slabs; s < slabs + n_slabs; s++) {
        for (size_t b = s->top; b < s->top_end; b++) upper_place(&p, b, levels->n - 1);
        for (size_t i = s->leaf; i < s->leaf_end; i++) block_place(&p, leaves[i].block);
    }
    return p.next;
}

size_t sdm_pod_mean_count(const sdm_pod_levels *levels, const sdm_pod_block *blocks)
{
    size_t n = 0;
    for (size_t b = 0; b < levels->first[1]; b++)
        n += sdm_panel_outputs(sdm_pod_block_voxels(&blocks[b]));
    return n;
}

void sdm_pod_products_fill(pod_network *m)
{
    size_t mean = 0;
    for (const pod_slab *s = m->slabs; s < m->slabs + m->n_slabs; s++)
        for (size_t i = s->leaf; i < s->leaf_end; i++) {
            const uint32_t b = m->leaves[i].block;
            const sdm_pod_block *k = &m->blocks[b];
            m->products[i] = (sdm_panel_block){.weights = m->weights_at[b],
                                               .mean = mean,
                                               .outputs = m->outputs[b],
                                               .n_wide = m->wide ? m->wide[b] : 0,
                                               .k = k->rank,
                                               .x = k->coefficient - s->coefficient,
                                               .scale = m->leaves[i].group * SDM_POD_ROWS,
                                               .y = k->at[0]};
            mean += sdm_panel_outputs(m->outputs[b]);
        }
}

void sdm_pod_place_coefficients(const sdm_pod_levels *levels, const sdm_pod_block *blocks,
                                size_t at[SDM_POD_MAX_LEVELS + 1])
{
    at[0] = 0;
    for (size_t l = 0; l < levels->n; l++) {
        const sdm_pod_block *last = &blocks[levels->first[l + 1] - 1];
        at[l + 1] = at[l] + last->coefficient + last->rank;
    }
}
