/* Stage 3: culling of features by their regions. A group of features is tested against the block;
   those whose regions meet it are queued for stage 4. Part of map.inc. */
#pragma once

#include "block.h"
#include "lists.h"
#include "stage1_bounds.h"

/* Largest change of each function of a group from the centre of the block to its corners. Replaces
   sdm_feature_group.sum where the block is not a cube along x, y, z; block.half[SDM_BLOCKS] is 1
   then. */
static void group_extent(const block *b, int kind, const sdm_feature_group *group, float out[4][8])
{
    const sdm_grid_parts *q = &b->job->part[SDM_BLOCKS];
    for (int j = 0; j < 4; j++) {
        point8 g = p8_load(group->g[j]);
        if (kind == SDM_EDGES && j == 3) // for (f1 + f2) / 2, see sdm_feature_group.sum
            g = p8_scale(p8_add(p8_load(group->g[1]), p8_load(group->g[2])), v8_all(0.5f));
        v8_store(out[j], extent_plus(q, b->job->aligned, g, v8_all(0)));
    }
}

/* Constants of the block, repeated in all lanes. They are copied so that the compiler need not
   reload them after stores. */
typedef struct block_test {
    const block *b;
    v8f minus_half, error;
} block_test;

static inline block_test block_test_start(const block *b)
{
    return (block_test){b, v8_all(-b->half[SDM_BLOCKS]), v8_all(b->error)};
}

/* Fills x with the functions of a group relative to the block, and returns the mask of the lanes
   whose features' regions meet the block. cube: block_is_cube(). The same test as region_excess(),
   with features in lanes instead of parts. */
SDM_FOR_KIND unsigned group_test(const block_test *w, bool cube, int kind,
                                 const sdm_feature_group *group, const sdm_cluster_ref *c,
                                 sdm_block_group *x)
{
    const point8 shift = p8_all(c->shift[0], c->shift[1], c->shift[2]);
    v8f at[4], excess = v8_all(-INFINITY);
    x->group = group;
    x->cluster = c;
    const float(*extent)[8] = x->extent = cube ? group->sum : (const float(*)[8])x->own_extent;
    if (!cube) group_extent(w->b, kind, group, x->own_extent);
    // each function at the centre of the block, less its largest change within the block
    for (int j = 0; j < (kind == SDM_CORNERS ? 3 : 4); j++) {
        at[j] = p8_linear(p8_load(group->g[j]), shift, v8_load(group->offset[j]));
        v8_store(x->at_block[j], at[j]);
        if (j == 3 && kind != SDM_THIN_FACES) break; // a distance, not a bound of the region
        v8f f = kind == SDM_EDGES && j == 0 ? v8_abs(at[j]) : at[j];
        if (kind == SDM_EDGES && j < 2) f = v8_sub(f, v8_load(group->most[j]));
        excess = v8_max(excess, v8_fma(w->minus_half, v8_load(extent[j]), f));
    }
    // (f1 + f2) / 2 <= 0 rejects concave edges
    if (kind == SDM_EDGES) {
        const v8f mean =
            v8_sub(v8_mul(v8_add(at[1], at[2]), v8_all(0.5f)), v8_load(group->most[1]));
        excess = v8_max(excess, v8_fma(w->minus_half, v8_load(extent[3]), mean));
    }
    // a corner meets the block if both of its lanes do
    const unsigned lanes = 0xff & ~(unsigned)v8_greater(excess, w->error);
    return kind == SDM_CORNERS ? lanes & lanes >> SDM_CORNER_LANES : lanes;
}

/* Queues the features in `lanes` of the group that group_test() has just written to
   p->group[p->n_group]. number: number of the feature in lane 0. Free of branches, because the
   masks are unpredictable. */
static inline void pending_add(const block *b, sdm_pending *p, uint32_t number, unsigned lanes)
{
    assert(p->n_group <= SDM_BATCH);
    p->group[p->n_group].number = number;
    p->n = lanes_append(b->job, p->feature, p->n, SDM_BATCH + 8, p->n_group, lanes);
    p->n_group += lanes != 0;
}
