/* Aligned memory with overflow checks and simulated failures for tests. */
#ifdef __linux__
#define _DEFAULT_SOURCE // for madvise()
#endif
#include "sdm/internal/heap.h"

#include <stdatomic.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#ifdef __linux__
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>
#endif

#define ALIGNMENT 64u
#define HUGE_PAGE ((size_t)2 << 20)

/* glibc keeps freed blocks below this size for later requests, unless they are aligned to more than
 * small blocks: then it hands their pages back, and the next request waits for pages that the
 * kernel clears (a fifth of the time of a band). */
#define KEPT_MAX ((size_t)32 << 20)

/* The number of allocations until one fails, that one included; 0: none fails. Set by tests only.
 */
static atomic_ulong fail_after;

void sdm_alloc_fail_after(unsigned long n) { atomic_store(&fail_after, n); }

static bool failure_due(void)
{
    return atomic_load_explicit(&fail_after, memory_order_relaxed) &&
           atomic_fetch_sub(&fail_after, 1) == 1;
}

sdm_status sdm_mul(size_t a, size_t b, size_t *out, sdm_error *err)
{
    if (b && a > SIZE_MAX / b)
        return sdm_fail(err, SDM_E_NOMEM, "%zu times %zu bytes is more than memory can hold", a, b);
    *out = a * b;
    return SDM_OK;
}

/* Allocates without initialisation. *used = bytes of the block, rounded up to the alignment or, for
 * a large block, to whole large pages. */
static sdm_status block_allocate(void **out, size_t count, size_t size, size_t *used,
                                 const char *what, sdm_error *err)
{
    *out = NULL;
    size_t bytes = 0;
    if (sdm_mul(count, size, &bytes, NULL) || bytes > SIZE_MAX - ALIGNMENT)
        return sdm_fail(err, SDM_E_NOMEM,
                        "%s: %zu elements of %zu bytes are more than memory can hold", what, count,
                        size);
    bytes = (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    if (!bytes) bytes = ALIGNMENT;
    void *block = NULL;
    // large pages cut the time of the first access to a big block by a third
    const bool large = bytes >= 2 * HUGE_PAGE && bytes <= SIZE_MAX - HUGE_PAGE;
    if (large) bytes = (bytes + HUGE_PAGE - 1) / HUGE_PAGE * HUGE_PAGE;
    const size_t align = large && bytes >= KEPT_MAX ? HUGE_PAGE : ALIGNMENT;
    if (!failure_due()) block = aligned_alloc(align, bytes);
#ifdef MADV_HUGEPAGE
    if (block && large) {
        const size_t skip = (HUGE_PAGE - (uintptr_t)block % HUGE_PAGE) % HUGE_PAGE;
        (void)madvise((char *)block + skip, (bytes - skip) / HUGE_PAGE * HUGE_PAGE, MADV_HUGEPAGE);
    }
#endif
    if (!block) return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for %zu bytes", what, bytes);
    *out = block;
    *used = bytes;
    return SDM_OK;
}

sdm_status sdm_alloc(void **out, size_t count, size_t size, const char *what, sdm_error *err)
{
    size_t used = 0;
    const sdm_status s = block_allocate(out, count, size, &used, what, err);
    if (!s) memset(*out, 0, used);
    return s;
}

sdm_status sdm_alloc_unset(void **out, size_t count, size_t size, const char *what, sdm_error *err)
{
    size_t used;
    return block_allocate(out, count, size, &used, what, err);
}

sdm_status sdm_grow(void **block, size_t old_count, size_t new_count, size_t size, const char *what,
                    sdm_error *err)
{
    void *bigger;
    const sdm_status s = sdm_alloc(&bigger, new_count, size, what, err);
    if (s) return s;
    const size_t kept = old_count < new_count ? old_count : new_count;
    if (*block && kept) memcpy(bigger, *block, kept * size);
    sdm_free(*block);
    *block = bigger;
    return SDM_OK;
}

void sdm_free(void *block) { free(block); }

uint64_t sdm_address_space(void)
{
    uint64_t pages = 0;
#ifdef __linux__
    char text[64] = "";
    const int f = open("/proc/self/statm", O_RDONLY | O_CLOEXEC);
    if (f < 0) return 0;
    const ssize_t n = read(f, text, sizeof text - 1);
    close(f);
    for (ssize_t i = 0; i < n && text[i] >= '0' && text[i] <= '9'; i++)
        pages = 10 * pages + (uint64_t)(text[i] - '0');
    pages *= (uint64_t)sysconf(_SC_PAGESIZE);
#endif
    return pages;
}
