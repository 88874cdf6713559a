/* Arrays from the two ends of a block. */
#include "arena.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

#include "sdm/internal/heap.h"

#define ALIGNMENT ((size_t)64)
// beyond it every array has its own: there pages are no matter, memory given back early is
#define LARGEST_BLOCK ((size_t)1 << 28)

/* A block of its own; the array follows. */
struct sdm_arena_extra {
    _Alignas(64) sdm_arena_extra *before;
    size_t bytes;
};

sdm_status sdm_arena_reserve(sdm_arena *a, size_t bytes, sdm_error *err)
{
    if (bytes > LARGEST_BLOCK) return SDM_OK;
    bytes = (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    const sdm_status s =
        sdm_alloc_unset((void **)&a->block, bytes, 1, "preparation of a mesh", err);
    if (!s) a->end[SDM_HIGH].at = bytes;
    return s;
}

static void free_extra(sdm_arena_mark *end, const sdm_arena_extra *until)
{
    while (end->extra != until) {
        sdm_arena_extra *x = end->extra;
        end->extra = x->before;
        sdm_free(x);
    }
}

size_t sdm_arena_extra_bytes(const sdm_arena *a)
{
    size_t bytes = 0;
    for (int end = SDM_LOW; end <= SDM_HIGH; end++)
        for (const sdm_arena_extra *x = a->end[end].extra; x; x = x->before) bytes += x->bytes;
    return bytes;
}

void sdm_arena_dispose(sdm_arena *a)
{
    free_extra(&a->end[SDM_LOW], NULL);
    free_extra(&a->end[SDM_HIGH], NULL);
    sdm_free(a->block);
    *a = (sdm_arena){0};
}

void sdm_arena_release(sdm_arena *a, int end, sdm_arena_mark mark)
{
    free_extra(&a->end[end], mark.extra);
    a->end[end] = mark;
}

sdm_status sdm_arena_take_unset(sdm_arena *a, int end, void **out, size_t count, size_t size,
                                const char *what, sdm_error *err)
{
    const size_t room = a->end[SDM_HIGH].at - a->end[SDM_LOW].at;
    if (!a->block || count > room / size ||
        (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT > room) {
        *out = NULL;
        if (count > (SIZE_MAX - sizeof(sdm_arena_extra)) / size)
            return sdm_fail(err, SDM_E_NOMEM,
                            "%s: %zu elements of %zu bytes are more than memory can hold", what,
                            count, size);
        sdm_arena_extra *x;
        const sdm_status s = sdm_alloc_unset((void **)&x, sizeof *x + count * size, 1, what, err);
        if (s) return s;
        x->before = a->end[end].extra;
        x->bytes = sizeof *x + count * size;
        a->end[end].extra = x;
        *out = x + 1;
        return SDM_OK;
    }
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
