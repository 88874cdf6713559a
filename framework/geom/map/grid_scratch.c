/* Scratch of the map kernels. */
#include <string.h>

#include "grid_job.h"
#include "sdm/internal/heap.h"

// a list is written eight at a time
#define LIST_SLACK ((size_t)8)
// room to begin with; pages that are not touched cost nothing
#define USUAL_CANDIDATES ((size_t)8192)

/* The lists of eight blocks are one block of memory. */
static sdm_status allocate_lists(sdm_cluster_list *c, size_t cap, sdm_error *err)
{
    cap += LIST_SLACK;
    const sdm_status st = SDM_ALLOC(&c[0].list, 8 * cap, "clusters of a block", err);
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
    sdm_status st =
        sdm_grow((void **)&s->node, old, cap + 8, sizeof *s->node, "clusters of a box", err);
    if (!st)
        st = sdm_grow((void **)&s->node_hit, old, cap + 8, sizeof *s->node_hit, "clusters of a box",
                      err);
    if (!st) st = allocate_lists(s->block, cap, err);
    if (!st) st = SDM_ALLOC(&s->cluster, cap + 1, "clusters of a box", err);
    if (!st) s->cluster_cap = cap;
    return st;
}

sdm_status sdm_grid_scratch_start(sdm_grid_scratch *s, sdm_error *err)
{
    sdm_status st = sdm_alloc_unset((void **)&s->pending, SDM_FEATURE_KINDS, sizeof *s->pending,
                                    "features of a block", err);
    if (!st)
        st = sdm_alloc_unset((void **)&s->batch, 1, sizeof *s->batch, "features of a block", err);
    return st ? st : SDM_ALLOC(&s->of_vectors, 1, "candidates of a block", err);
}

/* What a thread takes, but for clusters. */
static size_t bytes_of(size_t candidates)
{
    return SDM_FEATURE_KINDS * sizeof(sdm_pending) + sizeof(sdm_batch) + sizeof(sdm_candidates) +
           candidates * sizeof(sdm_candidate);
}

static sdm_status more_room(void **list, size_t n, size_t cap, size_t size, sdm_error *err)
{
    void *bigger;
    const sdm_status st = sdm_alloc_unset(&bigger, cap, size, "candidates of a block", err);
    if (st) return st;
    if (n) memcpy(bigger, *list, n * size);
    sdm_free(*list);
    *list = bigger;
    return SDM_OK;
}

sdm_status sdm_grid_scratch_candidates(sdm_grid_scratch *s, size_t cap, size_t limit,
                                       sdm_error *err)
{
    sdm_candidates *c = s->of_vectors;
    if (cap <= c->cap) return SDM_OK;
    if (limit && bytes_of(cap) > limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "a block of the map needs %zu bytes of scratch, the limit is %zu a thread; "
                        "raise memory_limit",
                        bytes_of(cap), limit);
    const size_t more = cap + cap / 2 < USUAL_CANDIDATES ? USUAL_CANDIDATES : cap + cap / 2;
    if (!limit || bytes_of(more) <= limit) cap = more;
    c->cap = 0;
    sdm_status st = more_room((void **)&c->list, c->n, cap, sizeof *c->list, err);
    if (!st) c->cap = cap;
    return st;
}

static void free_candidates(sdm_candidates *c)
{
    if (!c) return;
    sdm_free(c->list);
    sdm_free(c);
}

void sdm_grid_scratch_dispose(sdm_grid_scratch *s)
{
    sdm_free(s->pending);
    sdm_free(s->batch);
    free_candidates(s->of_vectors);
    sdm_free(s->node);
    sdm_free(s->node_hit);
    sdm_free(s->block[0].list);
    sdm_free(s->cluster);
    *s = (sdm_grid_scratch){0};
}
