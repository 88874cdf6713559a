/* Decompression of zlib data (RFC 1950, RFC 1951), for mesh files: the library itself does not
 * depend on zlib. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Decompresses in[n_in], a whole zlib stream, into out[n_out]. Returns true when the stream is
 * intact, holds exactly n_out bytes and its checksum is right. Reads and writes nothing else.
 * [any thread] */
bool sdm_inflate(const uint8_t *in, size_t n_in, uint8_t *out, size_t n_out);
