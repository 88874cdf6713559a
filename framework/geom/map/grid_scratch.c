/* Allocation of the scratch memory of one thread of the distance map. */
#include "grid_scratch.h"

#include <string.h>

#include "sdm/internal/heap.h"

// lists are written eight elements at a time, up to seven of them beyond the end
#define LIST_SLACK ((size_t)8)
// initial capacity; pages that are never touched cost nothing
#define INITIAL_CANDIDATES ((size_t)8192)

/* Allocates the lists of the eight blocks of a box, `cap` clusters each, as one memory block. */
static sdm_status cluster_lists_allocate(sdm_cluster_list *c, size_t cap, sdm_error *err)
{
    cap += LIST_SLACK;
    const sdm_status s = SDM_ALLOC(&c[0].list, 8 * cap, "clusters of a block", err);
    for (size_t i = 1; i < 8 && !s; i++) c[i].list = c[0].list + i * cap;
    return s;
}

sdm_status sdm_grid_scratch_clusters(sdm_grid_scratch *scratch, size_t cap, sdm_error *err)
{
    const size_t old = scratch->cluster_cap, padded = cap + LIST_SLACK;
    if (cap <= old) return SDM_OK;
    sdm_free(scratch->cluster);
    sdm_free(scratch->block[0].list);
    scratch->cluster = NULL;
    scratch->block[0].list = NULL;
    scratch->cluster_cap = 0;
    sdm_status s = sdm_grow((void **)&scratch->node, old, padded, sizeof *scratch->node,
                            "clusters of a box", err);
    if (!s)
        s = sdm_grow((void **)&scratch->node_blocks, old, padded, sizeof *scratch->node_blocks,
                     "clusters of a box", err);
    if (!s) s = cluster_lists_allocate(scratch->block, cap, err);
    if (!s) s = SDM_ALLOC(&scratch->cluster, cap + 1, "clusters of a box", err);
    if (!s) scratch->cluster_cap = cap;
    return s;
}

sdm_status sdm_grid_scratch_start(sdm_grid_scratch *scratch, sdm_error *err)
{
    sdm_status s = sdm_alloc_unset((void **)&scratch->pending, SDM_FEATURE_KINDS,
                                   sizeof *scratch->pending, "features of a block", err);
    if (!s)
        s = sdm_alloc_unset((void **)&scratch->batch, 1, sizeof *scratch->batch,
                            "features of a block", err);
    return s ? s : SDM_ALLOC(&scratch->candidates, 1, "candidates of a block", err);
}

/* Bytes of a thread's scratch with room for n candidates, without the lists of clusters. */
static size_t feature_bytes(size_t n)
{
    return SDM_FEATURE_KINDS * sizeof(sdm_pending) + sizeof(sdm_batch) + sizeof(sdm_candidates) +
           n * sizeof(sdm_candidate);
}

/* Enlarges the list to `cap` candidates; only the first c->n are copied. */
static sdm_status candidates_grow(sdm_candidates *c, size_t cap, sdm_error *err)
{
    void *bigger;
    c->cap = 0;
    const sdm_status s =
        sdm_alloc_unset(&bigger, cap, sizeof *c->list, "candidates of a block", err);
    if (s) return s;
    if (c->n) memcpy(bigger, c->list, c->n * sizeof *c->list);
    sdm_free(c->list);
    c->list = bigger;
    c->cap = cap;
    return SDM_OK;
}

sdm_status sdm_grid_scratch_candidates(sdm_grid_scratch *scratch, size_t cap, size_t limit,
                                       sdm_error *err)
{
    sdm_candidates *c = scratch->candidates;
    if (cap <= c->cap) return SDM_OK;
    if (limit && feature_bytes(cap) > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a block of the map needs %zu bytes of scratch, the limit is %zu a thread; "
                        "raise memory_limit",
                        feature_bytes(cap), limit);
    const size_t more = cap + cap / 2 < INITIAL_CANDIDATES ? INITIAL_CANDIDATES : cap + cap / 2;
    return candidates_grow(c, !limit || feature_bytes(more) <= limit ? more : cap, err);
}

void sdm_grid_scratch_dispose(sdm_grid_scratch *scratch)
{
    if (scratch->candidates) sdm_free(scratch->candidates->list);
    sdm_free(scratch->candidates);
    sdm_free(scratch->pending);
    sdm_free(scratch->batch);
    sdm_free(scratch->node);
    sdm_free(scratch->node_blocks);
    sdm_free(scratch->block[0].list);
    sdm_free(scratch->cluster);
    *scratch = (sdm_grid_scratch){0};
}
