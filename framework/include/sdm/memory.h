/* Memory allocation of the library: checked for overflow, 64-byte aligned. */
#ifndef SDM_MEMORY_H
#define SDM_MEMORY_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* *out = a new zeroed block of count * size bytes, 64-byte aligned, to be freed with sdm_free(). A
 * count of 0 gives a valid block. `what` names the block in the error message. SDM_E_NOMEM on
 * overflow or lack of memory; *out is then NULL. [any thread] */
SDM_API sdm_status sdm_alloc(void **out, size_t count, size_t size, const char *what,
                             sdm_error *err);

/* Frees a block that was allocated by the library; NULL is allowed. [any thread] */
SDM_API void sdm_free(void *block);

#ifdef __cplusplus
}
#endif

/* Allocates `count` elements of the type that *ptr points to: sdm_alloc() with the cast and the
 * element size. */
#define SDM_ALLOC(ptr, count, what, err)                                                           \
    sdm_alloc((void **)(ptr), (count), sizeof(**(ptr)), (what), (err))

#endif
