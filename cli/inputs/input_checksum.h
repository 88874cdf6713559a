/* The checksum of an input, as results of fits and cohorts state it. */
#pragma once

#include <stdint.h>

#include "sdm/status.h"

/* CRC-64/XZ of an input: of the bytes of the file and, if it is the header of an image whose voxels
 * are in a second file, of the values behind them. Errors of reading. */
sdm_status cli_input_checksum(const char *path, uint64_t *crc, sdm_error *err);
