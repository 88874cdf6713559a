/* Memory of the preparation of one mesh: arrays are taken from the two ends of one block, are all
 * freed at once, and are counted against the caller's memory limit. One block is faster than many
 * small ones: the allocator keeps its pages from one mesh to the next, and scratch memory is reused
 * while it is still in the cache. */
#pragma once

#include <stddef.h>

#include "sdm/exact.h"

/* The ends of the block. By convention the result of a step is taken from one end and its scratch
 * memory from the other, which the step releases when it returns. */
enum { SDM_LOW, SDM_HIGH };

typedef struct sdm_arena_extra sdm_arena_extra;

/* State of one end: offset in the block up to which it is used, and a list of separate allocations
 * for the arrays that did not fit in the block. */
typedef struct sdm_arena_mark {
    size_t at;
    sdm_arena_extra *extra;
} sdm_arena_mark;

/* Zero-initialise; sdm_arena_dispose() frees. Without a block every array is a separate
 * allocation. Not for several threads at once. */
typedef struct sdm_arena {
    char *block;
    sdm_arena_mark end[2];
    /* memory_limit and `cancelled` of the preparation; NULL: no limit, never cancelled */
    const sdm_exact_opts *opts;
    /* triangles of the mesh, for messages */
    size_t n_tri;
    /* bytes charged: all separate allocations, and what sdm_arena_charge() adds */
    size_t used;
} sdm_arena;

/* Allocates the block, at most once, for arrays of about `bytes` bytes in all. With a memory limit
 * there is no block, so that `used` counts exactly the arrays that are alive. SDM_E_NOMEM. */
sdm_status sdm_arena_reserve(sdm_arena *a, size_t bytes, sdm_error *err);
void sdm_arena_dispose(sdm_arena *a);

/* Sets *out to an array of `count` elements of `size` bytes, taken from one end. sdm_arena_take()
 * zeroes the array, sdm_arena_take_unset() leaves its content undefined. The bytes of a separate
 * allocation are charged. Freed by sdm_arena_release() or with the arena. `what` names the array in
 * messages. SDM_E_NOMEM: out of memory, or beyond the memory limit. */
sdm_status sdm_arena_take(sdm_arena *a, int end, void **out, size_t count, size_t size,
                          const char *what, sdm_error *err);
sdm_status sdm_arena_take_unset(sdm_arena *a, int end, void **out, size_t count, size_t size,
                                const char *what, sdm_error *err);

#define SDM_TAKE(arena, end, ptr, count, what, err)                                                \
    sdm_arena_take((arena), (end), (void **)(ptr), (count), sizeof(**(ptr)), (what), (err))
#define SDM_TAKE_UNSET(arena, end, ptr, count, what, err)                                          \
    sdm_arena_take_unset((arena), (end), (void **)(ptr), (count), sizeof(**(ptr)), (what), (err))

/* Frees the arrays taken from that end since it was in state `mark`, and refunds their bytes. */
void sdm_arena_release(sdm_arena *a, int end, sdm_arena_mark mark);

/* Charges memory that the preparation is about to allocate outside of the arena. SDM_E_NOMEM when
 * this exceeds the memory limit. When the memory is freed, the caller subtracts its bytes from
 * a->used. */
sdm_status sdm_arena_charge(sdm_arena *a, size_t bytes, sdm_error *err);
