/* Scratch of the map kernels. */
#include "grid_job.h"
#include "sdm/memory.h"

// a list is written eight at a time, and each of its kinds begins at a multiple of eight
#define LIST_SLACK ((size_t)8 * (SDM_FEATURE_KINDS + 1))
// room to begin with: growing costs pages
#define USUAL_BLOCK ((size_t)2048)
#define USUAL_ROWS ((size_t)512)
#define USUAL_TILE ((size_t)256)

static size_t usual(size_t cap, size_t least)
{
    cap += cap / 2;
    return cap < least ? least : cap;
}

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
    sdm_free(s->number);
    sdm_free(s->from);
    s->number = NULL;
    s->from = NULL;
    s->block_cap = 0;
}

static void free_rows(sdm_grid_scratch *s)
{
    sdm_free(s->row);
    sdm_free(s->row_hit);
    sdm_free(s->tile[0].list);
    s->row = NULL;
    s->row_hit = NULL;
    s->tile[0].list = NULL;
    s->row_cap = 0;
}

static void free_tile(sdm_grid_scratch *s)
{
    sdm_free(s->hit);
    sdm_free(s->vector[0].list);
    sdm_free(s->value);
    s->hit = NULL;
    s->vector[0].list = NULL;
    s->value = NULL;
    s->tile_cap = 0;
}

static size_t bytes(size_t block, size_t rows, size_t tile)
{
    const size_t lists = 8 * sizeof(uint32_t);
    return block * 2 * sizeof(uint32_t) + rows * (sizeof(sdm_feature_row) + 1 + lists) +
           tile * (1 + lists + sizeof(float[8]));
}

static sdm_status check_limit(size_t need, size_t limit, const char *part, sdm_error *err)
{
    if (!limit || need <= limit) return SDM_OK;
    return sdm_fail(err, SDM_E_NOMEM,
                    "a %s of the map needs %zu bytes of scratch, the limit is %zu a thread; raise memory_limit", part,
                    need, limit);
}

sdm_status sdm_grid_scratch_block(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err)
{
    if (cap <= s->block_cap) return SDM_OK;
    sdm_status st = check_limit(bytes(cap, s->row_cap, s->tile_cap), limit, "block", err);
    if (st) return st;
    const size_t more = usual(cap, USUAL_BLOCK);
    if (!limit || bytes(more, s->row_cap, s->tile_cap) <= limit) cap = more;
    free_block(s);
    st = SDM_ALLOC(&s->number, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = SDM_ALLOC(&s->from, cap + LIST_SLACK, "features of a block", err);
    if (!st) s->block_cap = cap;
    return st;
}

sdm_status sdm_grid_scratch_rows(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err)
{
    if (cap <= s->row_cap) return SDM_OK;
    sdm_status st = check_limit(bytes(s->block_cap, cap, s->tile_cap), limit, "block", err);
    if (st) return st;
    const size_t more = usual(cap, USUAL_ROWS);
    if (!limit || bytes(s->block_cap, more, s->tile_cap) <= limit) cap = more;
    free_rows(s);
    st = SDM_ALLOC(&s->row, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = SDM_ALLOC(&s->row_hit, cap + LIST_SLACK, "features of a block", err);
    if (!st) st = allocate_candidates(s->tile, cap, err);
    if (!st) s->row_cap = cap;
    return st;
}

sdm_status sdm_grid_scratch_tile(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err)
{
    if (cap <= s->tile_cap) return SDM_OK;
    sdm_status st = check_limit(bytes(s->block_cap, s->row_cap, cap), limit, "tile", err);
    if (st) return st;
    const size_t more = usual(cap, USUAL_TILE);
    if (!limit || bytes(s->block_cap, s->row_cap, more) <= limit) cap = more;
    free_tile(s);
    st = SDM_ALLOC(&s->hit, cap + LIST_SLACK, "candidates of a tile", err);
    if (!st) st = allocate_candidates(s->vector, cap, err);
    if (!st) st = SDM_ALLOC(&s->value, cap + LIST_SLACK, "candidates of a tile", err);
    if (!st) s->tile_cap = cap;
    return st;
}

void sdm_grid_scratch_dispose(sdm_grid_scratch *s)
{
    free_block(s);
    free_rows(s);
    free_tile(s);
    sdm_free(s->node);
    sdm_free(s->node_hit);
    sdm_free(s->block[0].list);
    sdm_free(s->cluster);
    *s = (sdm_grid_scratch){0};
}
