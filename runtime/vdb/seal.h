/* A checksum of the whole file behind a level set: readers of OpenVDB stop before it, and one wrong
   bit anywhere is found before any of the file is parsed. Internal to the level set library. */
#ifndef SDM_SEAL_H
#define SDM_SEAL_H

#include <stdbool.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Name of a metadata entry of every sealed file: a file that holds it and ends without a seal has
 * been cut or damaged. */
#define SDM_SEAL_MARK "sdm_sealed"

/* Appends the 16 bytes of the seal: "sdmgenCR" and the CRC-64 of all bytes before, little-endian.
 */
sdm_status sdm_seal_append(const char *path, sdm_error *err);

/* *sealed: whether the file ends with a seal. SDM_E_IO; SDM_E_FORMAT: the checksum differs, or a
 * sealed file has lost its seal. */
sdm_status sdm_seal_check(const char *path, bool *sealed, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
