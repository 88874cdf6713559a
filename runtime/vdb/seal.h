/* The seal is a checksum of the whole file, appended to a level set file. Readers of OpenVDB files
   stop before the seal. A wrong bit anywhere is found before any part of the file is parsed.
   Internal to the level set library. */
#pragma once

#include <stdbool.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Name of a metadata entry in every sealed file: a file that contains it but has no seal at its end
   was cut or damaged. */
#define SDM_SEAL_MARK "sdm_sealed"

/* Appends the 16 bytes of the seal: "sdmgenCR" and the CRC-64 of all bytes before it,
   little-endian. SDM_E_IO. */
sdm_status sdm_seal_append(const char *path, sdm_error *err);

/* *sealed = whether the file ends with a seal. SDM_E_IO; SDM_E_FORMAT: the checksum differs, or the
   file has the mark but no seal. */
sdm_status sdm_seal_check(const char *path, bool *sealed, sdm_error *err);

#ifdef __cplusplus
}
#endif
