/* Memory of one preparation: a block from whose two ends arrays are taken, freed all at once. Pages
   cost more than what small structures do with them: in one piece the allocator keeps them from one
   mesh to the next, and what is used in passing is used again. */
#ifndef SDM_GEOM_ARENA_H
#define SDM_GEOM_ARENA_H

#include <stddef.h>

#include "sdm/status.h"

/* What stays is taken from the low end, what goes with a release from the high end, or the other
 * way round. */
enum { SDM_LOW, SDM_HIGH };

typedef struct sdm_arena_extra sdm_arena_extra;

/* How far an end has been used, and the blocks of what did not fit. */
typedef struct sdm_arena_mark {
    size_t at;
    sdm_arena_extra *extra;
} sdm_arena_mark;

/* Zero-initialise; sdm_arena_dispose(). Works without a block, too. */
typedef struct sdm_arena {
    char *block;
    sdm_arena_mark end[2];
} sdm_arena;

/* The block, once, for arrays of about so many bytes. */
sdm_status sdm_arena_reserve(sdm_arena *a, size_t bytes, sdm_error *err);
void sdm_arena_dispose(sdm_arena *a);

/* As sdm_alloc() or sdm_alloc_unset(), from an end; freed by a release or with the arena. */
sdm_status sdm_arena_take(sdm_arena *a, int end, void **out, size_t count, size_t size,
                          const char *what, sdm_error *err);
sdm_status sdm_arena_take_unset(sdm_arena *a, int end, void **out, size_t count, size_t size,
                                const char *what, sdm_error *err);

#define SDM_TAKE(arena, end, ptr, count, what, err)                                                \
    sdm_arena_take((arena), (end), (void **)(ptr), (count), sizeof(**(ptr)), (what), (err))
#define SDM_TAKE_UNSET(arena, end, ptr, count, what, err)                                          \
    sdm_arena_take_unset((arena), (end), (void **)(ptr), (count), sizeof(**(ptr)), (what), (err))

/* Bytes in blocks of their own: all that is taken where there is no block. */
size_t sdm_arena_extra_bytes(const sdm_arena *a);

/* Frees what has been taken from that end since it was at `mark`. */
void sdm_arena_release(sdm_arena *a, int end, sdm_arena_mark mark);

#endif
