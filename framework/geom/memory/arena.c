/* Allocates arrays from the two ends of one block, and counts their bytes against the memory
   limit. */
#include "arena.h"

#include <stdint.h>
#include <string.h>

#include "sdm/internal/heap.h"

#define ALIGNMENT ((size_t)64)
// For larger meshes every array is a separate allocation: the cost of fresh pages no longer
// matters, and scratch memory goes back to the system early.
#define BLOCK_MAX ((size_t)1 << 28)

/* Header of a separate allocation; the array follows. */
struct sdm_arena_extra {
    _Alignas(64) sdm_arena_extra *before;
    size_t bytes; /* header included */
};

sdm_status sdm_arena_reserve(sdm_arena *a, size_t bytes, sdm_error *err)
{
    if (bytes > BLOCK_MAX || (a->opts && a->opts->memory_limit)) return SDM_OK;
    bytes = (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    const sdm_status s =
        sdm_alloc_unset((void **)&a->block, bytes, 1, "preparation of a mesh", err);
    if (!s) a->end[SDM_HIGH].at = bytes;
    return s;
}

sdm_status sdm_arena_charge(sdm_arena *a, size_t bytes, sdm_error *err)
{
    const size_t limit = a->opts ? a->opts->memory_limit : 0;
    a->used = bytes > SIZE_MAX - a->used ? SIZE_MAX : a->used + bytes;
    if (!limit || a->used <= limit) return SDM_OK;
    return sdm_fail(err, SDM_E_NOMEM,
                    "the mesh of %zu triangles needs at least %zu bytes to prepare, memory_limit "
                    "is %zu; raise it or use a coarser mesh",
                    a->n_tri, a->used, limit);
}

void sdm_arena_release(sdm_arena *a, int end, sdm_arena_mark mark)
{
    while (a->end[end].extra != mark.extra) {
        sdm_arena_extra *x = a->end[end].extra;
        a->end[end].extra = x->before;
        a->used -= x->bytes;
        sdm_free(x);
    }
    a->end[end].at = mark.at;
}

void sdm_arena_dispose(sdm_arena *a)
{
    sdm_arena_release(a, SDM_LOW, (sdm_arena_mark){0});
    sdm_arena_release(a, SDM_HIGH, (sdm_arena_mark){0});
    sdm_free(a->block);
    *a = (sdm_arena){0};
}

static sdm_status extra_take(sdm_arena *a, int end, void **out, size_t count, size_t size,
                             const char *what, sdm_error *err)
{
    *out = NULL;
    if (count > (SIZE_MAX - sizeof(sdm_arena_extra)) / size)
        return sdm_fail(err, SDM_E_NOMEM,
                        "%s: %zu elements of %zu bytes are more than memory can hold", what, count,
                        size);
    sdm_arena_extra *x;
    const size_t bytes = sizeof *x + count * size;
    sdm_status s = sdm_arena_charge(a, bytes, err);
    if (s) return s;
    s = sdm_alloc_unset((void **)&x, bytes, 1, what, err);
    if (s) return s;
    *x = (sdm_arena_extra){a->end[end].extra, bytes};
    a->end[end].extra = x;
    *out = x + 1;
    return SDM_OK;
}

sdm_status sdm_arena_take_unset(sdm_arena *a, int end, void **out, size_t count, size_t size,
                                const char *what, sdm_error *err)
{
    const size_t room = a->end[SDM_HIGH].at - a->end[SDM_LOW].at;
    if (!a->block || count > room / size ||
        (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT > room)
        return extra_take(a, end, out, count, size, what, err);
    const size_t bytes = (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    size_t *at = &a->end[end].at;
    const size_t from = end == SDM_LOW ? *at : *at - bytes;
    *out = a->block + from;
    *at = end == SDM_LOW ? from + bytes : from;
    return SDM_OK;
}

sdm_status sdm_arena_take(sdm_arena *a, int end, void **out, size_t count, size_t size,
                          const char *what, sdm_error *err)
{
    const sdm_status s = sdm_arena_take_unset(a, end, out, count, size, what, err);
    if (!s && count) memset(*out, 0, count * size);
    return s;
}
