/* Scratch of the map kernels. */
#include "grid_job.h"
#include "sdm/memory.h"

// a list is written eight at a time, and each of its kinds begins at a multiple of eight
#define LIST_SLACK ((size_t)8 * (SDM_FEATURE_KINDS + 1))

/* The lists of eight parts are one block of memory. */
static sdm_status allocate_candidates(sdm_candidates *c, size_t cap, sdm_error *err)
{
    cap += LIST_SLACK;
    const sdm_status st = SDM_ALLOC(&c[0].list, 8 * cap, "candidates of a tile", err);
    for (size_t i = 1; i < 8 && !st; i++) c[i].list = c[0].list + i * cap;
    return st;
}

sdm_status sdm_grid_scratch_box(sdm_grid_scratch *s, size_t cap, sdm_error *err)
{
    const size_t old = s->cluster_cap;
    if (cap <= old) return SDM_OK;
    sdm_free(s->cluster);
    sdm_free(s->block[0].list);
    s->cluster = NULL;
    s->block[0].list = NULL;
    s->cluster_cap = 0;
    sdm_status st = sdm_grow((void **)&s->node, old, cap + 8, sizeof *s->node, "clusters of a box", err);
    if (!st) st = sdm_grow((void **)&s->node_hit, old, cap + 8, sizeof *s->node_hit, "clusters of a box", err);
    if (!st) st = allocate_candidates(s->block, cap, err);
    if (!st) st = SDM_ALLOC(&s->cluster, cap + 1, "clusters of a box", err);
    if (!st) s->cluster_cap = cap;
    return st;
}

static void free_block(sdm_grid_scratch *s)
{
    sdm_free(s->row);
    sdm_free(s->number);
    sdm_free(s->from);
    sdm_free(s->row_hit);
    sdm_free(s->tile[0].list);
    s->row = NULL;
    s->number = NULL;
    s->from = NULL;
    s->row_hit = NULL;
    s->tile[0].list = NULL;
    s->row_cap = 0;
}

static void free_tile(sdm_grid_scratch *s)
{
    sdm_free(s->sight);
    sdm_free(s->hit);
    sdm_free(s->vector[0].list);
    sdm_free(s->value);
    s->sight = NULL;
    s->hit = NULL;
    s->vector[0].list = NULL;
    s->value = NULL;
    s->tile_cap = 0;
}

static size_t bytes(size_t block, size_t tile)
{
    const size_t lists = 8 * sizeof(uint32_t);
    return block * (sizeof(sdm_feature_row) + 2 * sizeof(uint32_t) + 1 + lists) +
           tile * (sizeof(sdm_sight) + 1 + lists + sizeof(float[8]));
}

sdm_status sdm_grid_scratch_block(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err)
{
    if (cap <= s->row_cap) return SDM_OK;
    const size_t need = bytes(cap, s->tile_cap);
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a block of the map needs %zu bytes of scratch, the limit is %zu a thread; raise memory_limit",
                        need, limit);
    if (!limit || bytes(cap + cap / 2, s->tile_cap) <= limit) cap += cap / 2;
    free_block(s);
    sdm_status st = SDM_ALLOC(&s->row, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = SDM_ALLOC(&s->number, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = SDM_ALLOC(&s->from, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = SDM_ALLOC(&s->row_hit, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = allocate_candidates(s->tile, cap, err);
    if (!st) s->row_cap = cap;
    return st;
}

sdm_status sdm_grid_scratch_tile(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err)
{
    if (cap <= s->tile_cap) return SDM_OK;
    const size_t need = bytes(s->row_cap, cap);
    if (limit && need > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a tile of the map needs %zu bytes of scratch, the limit is %zu a thread; raise memory_limit",
                        need, limit);
    if (!limit || bytes(s->row_cap, cap + cap / 2) <= limit) cap += cap / 2;
    free_tile(s);
    sdm_status st = SDM_ALLOC(&s->sight, cap + LIST_SLACK, "candidates of a tile", err);
    if (!st) st = SDM_ALLOC(&s->hit, cap + LIST_SLACK, "candidates of a tile", err);
    if (!st) st = allocate_candidates(s->vector, cap, err);
    if (!st) st = SDM_ALLOC(&s->value, cap + LIST_SLACK, "candidates of a tile", err);
    if (!st) s->tile_cap = cap;
    return st;
}

void sdm_grid_scratch_dispose(sdm_grid_scratch *s)
{
    free_block(s);
    free_tile(s);
    sdm_free(s->node);
    sdm_free(s->node_hit);
    sdm_free(s->block[0].list);
    sdm_free(s->cluster);
    *s = (sdm_grid_scratch){0};
}
