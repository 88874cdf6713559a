/* Checked memory: every product of sizes is tested for overflow, every block is 64-byte aligned. */
#ifndef SDM_MEMORY_H
#define SDM_MEMORY_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *out = a * b; SDM_E_NOMEM on overflow. */
SDM_API sdm_status sdm_mul(size_t a, size_t b, size_t *out, sdm_error *err);

/* *out = new zeroed block of count * size bytes, 64-byte aligned, freed with sdm_free(). A count of 0 gives a valid
   block. `what` names the block in the message. SDM_E_NOMEM on overflow or when memory is short. */
SDM_API sdm_status sdm_alloc(void **out, size_t count, size_t size, const char *what, sdm_error *err);

/* The same without the zeros, for what is written before it is read: clearing costs as much as writing. */
SDM_API sdm_status sdm_alloc_unset(void **out, size_t count, size_t size, const char *what, sdm_error *err);

/* Grows *block from old_count to new_count elements (geometric growth is the caller's); the added part is zeroed. On
   error *block is unchanged and still owned by the caller. */
SDM_API sdm_status sdm_grow(void **block, size_t old_count, size_t new_count, size_t size, const char *what,
                            sdm_error *err);

/* Frees a block of the functions above; NULL is fine. */
SDM_API void sdm_free(void *block);

/* For tests: lets the n-th following sdm_alloc() fail (1 = the next one); 0 switches the trap off. Not thread safe. */
SDM_API void sdm_alloc_fail_after(unsigned long n);

#ifdef __cplusplus
}
#endif

/* Allocates `count` elements of the type that *ptr points to: sdm_alloc with the cast and the size in one place. */
#define SDM_ALLOC(ptr, count, what, err) sdm_alloc((void **)(ptr), (count), sizeof(**(ptr)), (what), (err))

#endif
