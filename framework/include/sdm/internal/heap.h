/* Memory functions for use inside the library (see sdm/memory.h): overflow checks, growing arrays,
 * simulated failures for tests. */
#pragma once

#include "sdm/internal/shared.h"
#include "sdm/memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *out = a * b; SDM_E_NOMEM on overflow. [any thread] */
SDM_INTERNAL_API sdm_status sdm_mul(size_t a, size_t b, size_t *out, sdm_error *err);

/* As sdm_alloc(), but without zeroing, for blocks that are completely written before they are read:
 * zeroing costs as much as writing. [any thread] */
SDM_INTERNAL_API sdm_status sdm_alloc_unset(void **out, size_t count, size_t size, const char *what,
                                            sdm_error *err);

/* Changes the size of *block from old_count to new_count elements; new elements are zero. *block
 * may be NULL. The elements are copied, so the caller should choose new_count for geometric growth.
 * On SDM_E_NOMEM *block is unchanged and still owned by the caller. [any thread] */
SDM_INTERNAL_API sdm_status sdm_grow(void **block, size_t old_count, size_t new_count, size_t size,
                                     const char *what, sdm_error *err);

/* Size of the address space of this process, bytes, to which limits of memory are added; 0: not
 * known. May be called in handlers of signals. [any thread] */
uint64_t sdm_address_space(void);

/* For tests: makes the n-th allocation from now fail (1: the next one; 0: none). The allocations of
 * all threads are counted. */
void sdm_alloc_fail_after(unsigned long n);

#ifdef __cplusplus
}
#endif
