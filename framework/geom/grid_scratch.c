/* Scratch of the map kernels. */
#include "grid_job.h"
#include "sdm/memory.h"

sdm_status sdm_cluster_list_reserve(sdm_cluster_list *l, size_t cap, sdm_error *err)
{
    if (cap <= l->cap) return SDM_OK;
    sdm_status st = sdm_grow((void **)&l->node, l->cap, cap, sizeof *l->node, "clusters of a box", err);
    if (!st) st = sdm_grow((void **)&l->mask, l->cap, cap, sizeof *l->mask, "clusters of a box", err);
    if (!st) l->cap = cap;
    return st;
}

static void free_candidates(sdm_candidates *c)
{
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < SDM_FEATURE_KINDS; k++) {
            sdm_free(c[i].list[k]);
            c[i].list[k] = NULL;
        }
}

/* Lists are written eight at a time. */
static sdm_status allocate_candidates(sdm_candidates *c, size_t cap, sdm_error *err)
{
    sdm_status st = SDM_OK;
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < SDM_FEATURE_KINDS && !st; k++)
            st = SDM_ALLOC(&c[i].list[k], cap + 8, "candidates of a tile", err);
    return st;
}

static void free_block(sdm_grid_scratch *s)
{
    free_candidates(s->tile);
    s->tile_cap = 0;
}

static void free_tile(sdm_grid_scratch *s)
{
    free_candidates(s->vector);
    sdm_free(s->local);
    sdm_free(s->number);
    sdm_free(s->thin);
    sdm_free(s->distance);
    sdm_free(s->hit);
    sdm_free(s->value);
    s->local = NULL;
    s->number = NULL;
    s->thin = NULL;
    s->distance = NULL;
    s->hit = NULL;
    s->value = NULL;
    s->local_cap = 0;
}

static size_t bytes(size_t block, size_t tile)
{
    const size_t lists = 8 * SDM_FEATURE_KINDS * sizeof(uint32_t);
    return block * 8 * lists + tile * (8 * lists + sizeof(sdm_feature_group) + 8 * sizeof(uint32_t) +
                                       sizeof(float[8][8]) + 8 * sizeof(float[8]) + 9);
}

sdm_status sdm_grid_scratch_block(sdm_grid_scratch *s, size_t groups, size_t limit, sdm_error *err)
{
    if (groups <= s->tile_cap) return SDM_OK;
    const size_t need = bytes(groups, s->local_cap);
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a block of the map needs %zu bytes of scratch, the limit is %zu a thread; raise memory_limit",
                        need, limit);
    if (!limit || bytes(2 * groups, s->local_cap) <= limit) groups *= 2;
    free_block(s);
    sdm_status st = allocate_candidates(s->tile, 8 * groups, err);
    if (!st) s->tile_cap = groups;
    return st;
}

sdm_status sdm_grid_scratch_tile(sdm_grid_scratch *s, size_t groups, size_t limit, sdm_error *err)
{
    if (groups <= s->local_cap) return SDM_OK;
    const size_t need = bytes(s->tile_cap, groups);
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a tile of the map needs %zu bytes of scratch, the limit is %zu a thread; raise memory_limit",
                        need, limit);
    if (!limit || bytes(s->tile_cap, 2 * groups) <= limit) groups *= 2;
    free_tile(s);
    sdm_status st = allocate_candidates(s->vector, 8 * groups, err);
    if (!st) st = SDM_ALLOC(&s->local, groups, "candidates of a tile", err);
    if (!st) st = SDM_ALLOC(&s->number, 8 * groups, "candidates of a tile", err);
    if (!st) st = SDM_ALLOC(&s->thin, groups, "candidates of a tile", err);
    if (!st) st = SDM_ALLOC(&s->distance, groups, "candidates of a tile", err);
    if (!st) st = SDM_ALLOC(&s->hit, groups, "candidates of a tile", err);
    if (!st) st = SDM_ALLOC(&s->value, 8 * groups, "candidates of a tile", err);
    if (!st) s->local_cap = groups;
    return st;
}

void sdm_grid_scratch_dispose(sdm_grid_scratch *s)
{
    sdm_free(s->box.node);
    sdm_free(s->box.mask);
    sdm_free(s->block.node);
    sdm_free(s->block.mask);
    free_block(s);
    free_tile(s);
    *s = (sdm_grid_scratch){0};
}
