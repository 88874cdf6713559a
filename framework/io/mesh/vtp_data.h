/* The bytes of a DataArray of a .vtp file: raw or in base64, whole or in compressed blocks. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* Where the bytes of an array are, and how they are stored. */
typedef struct sdm_vtp_source {
    const char *path;             /* for messages */
    const uint8_t *start;         /* begin of the file, for messages */
    const uint8_t *at, *end;      /* the bytes or characters of the array, and what follows */
    bool base64, compressed, big; /* big: the headers are big-endian */
    size_t header_size;           /* 4 or 8: bytes of a number of the header */
} sdm_vtp_source;

/* *bytes = a new block with the *size bytes of the array, to be freed with sdm_free(). No more than
 * the file can hold is allocated. SDM_E_FORMAT, SDM_E_NOMEM. */
sdm_status sdm_vtp_bytes(sdm_vtp_source *d, uint8_t **bytes, size_t *size, sdm_error *err);
