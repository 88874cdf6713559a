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

/* The CRC-64 of any bytes that end with the CRC-64 of the bytes before them (little-endian), as
 * containers do (model files, .ssm): it is the same for all of them and says nothing of the
 * content.
 */
#define SDM_CRC64_WITH_OWN 0xb66a73654282cac0u

/* Checksum that tells files apart: the CRC-64 of `size` bytes at `data`; if they end with the
 * CRC-64 of the bytes before them, that CRC-64. [any thread] */
uint64_t sdm_content_checksum(const void *data, size_t size);

/* *crc = checksum of the content of a regular file, as sdm_content_checksum() computes it.
 * SDM_E_IO, SDM_E_NOMEM. [any thread] */
sdm_status sdm_file_checksum(const char *path, uint64_t *crc, sdm_error *err);

#ifdef __cplusplus
}
#endif
