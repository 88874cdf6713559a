/* The file of models and checkpoints: named sections, 64-byte aligned, a checksum for each and one
   over the whole. Little-endian:

   offset  0  "SDMGEN\r\n"      8 bytes (the line end shows a transfer as text)
           8  version           u32, SDM_CONTAINER_VERSION
          12  number of sections u32, 1 .. 64
          16  length of the file u64
          24  table             for each section: name[24] (zero-padded), offset u64, size u64,
   CRC-64 u64 .  CRC-64 of all bytes before it (header) .  sections, each at a multiple of 64, gaps
   zero last 8  CRC-64 of all bytes before it (whole file) */
#ifndef SDM_CONTAINER_H
#define SDM_CONTAINER_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_CONTAINER_VERSION 4u
#define SDM_CONTAINER_MAX_SECTIONS 64u

typedef struct sdm_section {
    const char *name; /* at most 23 characters */
    const void *data;
    size_t size;
} sdm_section;

/* Builds the file in memory: *bytes (sdm_free()) and *size. */
sdm_status sdm_container_build(const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                               sdm_error *err);

/* Writes a built file atomically. */
sdm_status sdm_container_write(const char *path, const uint8_t *bytes, size_t size, sdm_error *err);

/* Checks everything (magic, version, sizes, overlaps, checksums) and fills
   sections[SDM_CONTAINER_MAX_SECTIONS] with pointers into `bytes` (whose first byte must be 64-byte
   aligned). SDM_E_FORMAT says what is wrong. names[] holds the section names. */
sdm_status sdm_container_parse(const uint8_t *bytes, size_t size, sdm_section *sections,
                               char names[SDM_CONTAINER_MAX_SECTIONS][24], size_t *n,
                               uint64_t *checksum, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
