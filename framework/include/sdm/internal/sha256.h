/* SHA-256, the cryptographic hash of FIPS 180-4: the CRC-64 of a file finds damage, this one also
 * finds a file that somebody has exchanged. */
#pragma once

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_SHA256_TEXT 65

/* text = the hash of `size` bytes at `data`, as 64 hexadecimal digits. Returns text. [any thread]
 */
const char *sdm_sha256(const void *data, size_t size, char text[SDM_SHA256_TEXT]);

#ifdef __cplusplus
}
#endif
