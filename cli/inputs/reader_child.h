/* Reads files in a child process with limits, for libraries that write past their memory, ask for
 * all there is, or do not end when a file is damaged in the wrong place. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

/* Reads a file: *bytes = new block [*size], to be freed with sdm_free(). On error *bytes is NULL.
 */
typedef sdm_status cli_reader(const void *user, const char *path, char **bytes, size_t *size,
                              sdm_error *err);

/* Calls read() in a child process, for a program without other threads: 512 MB and 2 s of processor
 * time for a small file, more for a large one (32 bytes and 1 us for each of its bytes). What the
 * library prints is dropped. *bytes = new block [*size], which a damaged file may have chosen, and
 * a zero behind it, freed with sdm_free(). `library` is for messages. Errors of read(); SDM_E_IO:
 * not a regular file, or no process; SDM_E_FORMAT: the child crashed or reached a limit. On error
 * *bytes is NULL. */
sdm_status cli_read_in_child(const char *path, const char *library, cli_reader *read,
                             const void *user, char **bytes, size_t *size, sdm_error *err);
