/* Reads whole files up to a size limit and writes files atomically: temporary name, fsync, rename,
 * fsync of the folder. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/shared.h"
#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads a regular file of at most max_bytes into a new block, followed by a zero byte; free it with
 * sdm_free(). *size: bytes of the file. SDM_E_IO if it cannot be read, SDM_E_FORMAT if it is
 * larger, SDM_E_NOMEM. On error *data is NULL. [any thread] */
sdm_status sdm_file_read(const char *path, uint64_t max_bytes, uint8_t **data, size_t *size,
                         sdm_error *err);

/* Reads a text file as sdm_file_read() does. *lines: number of its lines, a last one without a line
 * feed included. SDM_E_FORMAT also if it holds a zero byte. [any thread] */
sdm_status sdm_file_read_text(const char *path, uint64_t max_bytes, char **text, size_t *size,
                              size_t *lines, sdm_error *err);

/* Writes a whole file as an output file (below) does. SDM_E_IO, SDM_E_NOMEM. [any thread] */
sdm_status sdm_file_write(const char *path, const void *data, size_t size, sdm_error *err);

/* An output file: nothing appears under its final name before sdm_outfile_commit() succeeds. */
typedef struct sdm_outfile sdm_outfile;

/* Opens a new temporary file in the folder of `path`, with a unique name for every call. A regular
 * file that exists at `path` is replaced at commit and hands its permissions on; its owner may
 * write the new one. A link is replaced by a file. SDM_E_IO if the folder is not writable, or if
 * `path` exists and is not a regular file. SDM_E_NOMEM. */
SDM_INTERNAL_API sdm_status sdm_outfile_open(const char *path, sdm_outfile **out, sdm_error *err);

/* Name of the temporary file, for libraries that open files by name; valid until commit or
 * discard. */
SDM_INTERNAL_API const char *sdm_outfile_temp_path(const sdm_outfile *f);

/* True if `name` is one that the temporary file of an output `of` can have: of.PID.COUNTER.tmp.
 * Both are without folders. */
bool sdm_outfile_is_temp(const char *name, const char *of);

/* Appends bytes (buffered). After an error only sdm_outfile_discard() is allowed. SDM_E_IO. */
SDM_INTERNAL_API sdm_status sdm_outfile_write(sdm_outfile *f, const void *data, size_t size,
                                              sdm_error *err);

/* Writes what is in the buffer. After a fork the process that has written calls it before another
 * one commits the file. SDM_E_IO. */
SDM_INTERNAL_API sdm_status sdm_outfile_flush(sdm_outfile *f, sdm_error *err);

/* Appends formatted text. SDM_E_IO, SDM_E_NOMEM. */
sdm_status sdm_outfile_printf(sdm_outfile *f, sdm_error *err, const char *fmt, ...)
    SDM_PRINTF(3, 4);

/* Flushes, calls fsync, renames to the final name and calls fsync for the folder. Frees *f in all
 * cases. On error (SDM_E_IO) the temporary file is removed and an existing file of the final name
 * is unchanged. */
SDM_INTERNAL_API sdm_status sdm_outfile_commit(sdm_outfile **f, sdm_error *err);

/* Removes the temporary file and frees *f; *f may be NULL. */
SDM_INTERNAL_API void sdm_outfile_discard(sdm_outfile **f);

/* Removes the temporary files of this process (up to 64), for its end after a fault: the output
 * files must not be used any more. May be called in handlers of signals. */
SDM_INTERNAL_API void sdm_outfile_remove_temps(void);

/* Creates the folder `path` and its missing parents (mode 0777 with the umask). It is no error if
 * the folder exists. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM. */
sdm_status sdm_make_folder(const char *path, sdm_error *err);

/* Returns the length of the longest part of `path`, up to a '/' or its end, that exists; 0: none.
 */
size_t sdm_folder_existing(const char *path);

/* Takes back sdm_make_folder(): removes the folder `path` and its parents with names longer than
 * `existing` characters (sdm_folder_existing() before they were made), as far as they are empty. */
void sdm_folder_remove_empty(const char *path, size_t existing);

#ifdef __cplusplus
}
#endif
