/* The file format of models, checkpoints and shards of maps: named sections, 64-byte aligned, with
   one checksum for each and one for the whole file. Little-endian:

     offset 0   "SDMGEN\r\n"   8 bytes; a transfer as text changes the line end and is detected
            8   version        u32, SDM_CONTAINER_VERSION
           12   sections       u32, number of sections, 1 .. SDM_CONTAINER_MAX_SECTIONS
           16   length         u64, length of the file in bytes
           24   table          for each section: name[24], padded with zeros,
                               then u64 each: offset, size, CRC-64
     then       checksum       u64, CRC-64 of all bytes before it
     then       sections       each at a multiple of 64, gaps filled with zeros
     last 8     checksum       u64, CRC-64 of all bytes before it */
#pragma once

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

/* *bytes = the file with sections[n], *size bytes, to be freed with sdm_free(); NULL on error.
   SDM_E_NOMEM; SDM_E_INTERNAL: n or the length of a name is out of range. [any thread] */
sdm_status sdm_container_build(const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                               sdm_error *err);

/* Writes a built file to `path` atomically: after an error (SDM_E_IO, SDM_E_NOMEM) an existing file
   is unchanged. [any thread] */
sdm_status sdm_container_write(const char *path, const uint8_t *bytes, size_t size, sdm_error *err);

/* Bytes at the beginning of a file that hold its header with any table. */
#define SDM_CONTAINER_HEAD_BYTES (24 + 48 * SDM_CONTAINER_MAX_SECTIONS + 8)

/* Where a section lies in the file, and the checksum that its content has. */
typedef struct sdm_section_place {
    char name[24]; /* zero-terminated */
    uint64_t at, size, checksum;
} sdm_section_place;

/* Reads header and table of a file of `size` bytes from its first bytes, `head`, at least the
   smaller of `size` and SDM_CONTAINER_HEAD_BYTES: sets *n and places[0 .. *n - 1]; places[] has
   room for SDM_CONTAINER_MAX_SECTIONS. The contents are not looked at. SDM_E_FORMAT as
   sdm_container_parse(). [any thread] */
sdm_status sdm_container_places(const uint8_t *head, uint64_t size, sdm_section_place *places,
                                size_t *n, sdm_error *err);

/* Parses the file bytes[size], 64-byte aligned: sets *n, *checksum (the one in the last 8 bytes),
   and sections[0 .. *n - 1], whose data point into `bytes` and whose names point into names[].
   sections[] has room for SDM_CONTAINER_MAX_SECTIONS. SDM_E_FORMAT: the magic number, the version,
   a size, the position of a section or a checksum is wrong; the message names the reason. [any
   thread] */
sdm_status sdm_container_parse(const uint8_t *bytes, size_t size, sdm_section *sections,
                               char names[SDM_CONTAINER_MAX_SECTIONS][24], size_t *n,
                               uint64_t *checksum, sdm_error *err);

#ifdef __cplusplus
}
#endif
