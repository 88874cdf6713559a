/* Whole-file reading with a size limit, and atomic writing: temporary name, fsync, rename, fsync of
 * the folder. */
#ifndef SDM_FILE_H
#define SDM_FILE_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/shared.h"
#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Reads a regular file of at most max_bytes into a new block (sdm_free()), with one zero byte
   behind the content. SDM_E_IO when it cannot be read, SDM_E_FORMAT when it is larger, SDM_E_NOMEM
   when memory cannot hold it. */
sdm_status sdm_file_read(const char *path, uint64_t max_bytes, uint8_t **data, size_t *size,
                         sdm_error *err);

/* A file under construction: nothing appears under its final name before sdm_outfile_commit()
 * succeeds. */
typedef struct sdm_outfile sdm_outfile;

/* Opens a temporary file beside `path`, of its own for every call, also of one path. SDM_E_IO when
   the folder cannot be written, and when `path` is neither a regular file (or a link to one: the
   link is replaced) nor new. */
SDM_INTERNAL_API sdm_status sdm_outfile_open(const char *path, sdm_outfile **out, sdm_error *err);

/* Name of the temporary file, for libraries that write by name; valid until commit or discard. */
SDM_INTERNAL_API const char *sdm_outfile_temp_path(const sdm_outfile *f);

/* Appends bytes (buffered). After an error only discard is left. */
SDM_INTERNAL_API sdm_status sdm_outfile_write(sdm_outfile *f, const void *data, size_t size,
                                              sdm_error *err);

/* Appends formatted text. */
sdm_status sdm_outfile_printf(sdm_outfile *f, sdm_error *err, const char *fmt, ...)
    SDM_PRINTF(3, 4);

/* Flushes, fsyncs, renames to the final name and fsyncs the folder. Frees *f in every case; on
   error the temporary file is removed and a file of the final name is as it was. */
SDM_INTERNAL_API sdm_status sdm_outfile_commit(sdm_outfile **f, sdm_error *err);

/* Removes the temporary file and frees *f; NULL is fine. */
SDM_INTERNAL_API void sdm_outfile_discard(sdm_outfile **f);

/* Creates `path` and its missing parents (mode 0777 under the umask); no error when it exists as a
 * folder. */
sdm_status sdm_make_folder(const char *path, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
