/* CRC-64/XZ (reflected polynomial 0xC96C5795D7870F42, ECMA-182); it detects every burst error of up
 * to 64 bits. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/shared.h"
#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Checksum of `size` bytes at `data`. crc: checksum of the bytes before them, 0 at the start.
 * [any thread] */
SDM_INTERNAL_API uint64_t sdm_crc64(uint64_t crc, const void *data, size_t size);

/* Checksum of the content of a regular file. SDM_E_IO, SDM_E_NOMEM. [any thread] */
sdm_status sdm_file_checksum(const char *path, uint64_t *crc, sdm_error *err);

#ifdef __cplusplus
}
#endif
