/* Memory for the parts of the library: sizes, growth, and the trap of the tests. */
#ifndef SDM_INTERNAL_HEAP_H
#define SDM_INTERNAL_HEAP_H

#include "sdm/internal/shared.h"
#include "sdm/memory.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *out = a * b; SDM_E_NOMEM on overflow. */
SDM_INTERNAL_API sdm_status sdm_mul(size_t a, size_t b, size_t *out, sdm_error *err);

/* The same without the zeros, for what is written before it is read: clearing costs as much as
 * writing. */
sdm_status sdm_alloc_unset(void **out, size_t count, size_t size, const char *what, sdm_error *err);

/* Grows *block from old_count to new_count elements (geometric growth is the caller's); the added
   part is zeroed. On error *block is unchanged and still owned by the caller. */
SDM_INTERNAL_API sdm_status sdm_grow(void **block, size_t old_count, size_t new_count, size_t size,
                                     const char *what, sdm_error *err);

/* For tests: lets the n-th following sdm_alloc() fail (1 = the next one); 0 switches the trap off.
 * Not thread safe. */
void sdm_alloc_fail_after(unsigned long n);

#ifdef __cplusplus
}
#endif
#endif
