/* What the fuzz targets share. A target is the function LLVMFuzzerTestOneInput() in a file of its
 * own: it gives the input to one reader and aborts where the reader breaks a promise. libFuzzer
 * calls it with inputs of its own; fuzz_replay.c, with the files of a corpus. */
#ifndef FUZZ_READER_H
#define FUZZ_READER_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/mesh.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Ends the process unless `holds`. */
void fuzz_require(int holds);

/* A copy of data[size], 64-byte aligned, at the end of its block: AddressSanitizer notices a read
 * behind it. Free it with free(). */
uint8_t *fuzz_copy(const uint8_t *data, size_t size);

/* The folder for files of this process, without a '/' at its end; it is removed at the exit. */
const char *fuzz_folder(void);

/* Writes data[size] to a file `name` in that folder and returns its path, which the next call
 * overwrites. */
const char *fuzz_file(const char *name, const uint8_t *data, size_t size);

#define FUZZ_OVERRIDES_MAX 8

/* An input of texts: a file, followed by arguments "key=value", each preceded by the byte 0x01. */
typedef struct fuzz_texts {
    char *file; /* [file_size], without a zero behind it */
    size_t file_size;
    const char *overrides[FUZZ_OVERRIDES_MAX];
    size_t n_overrides;
    char *all; /* owns the overrides */
} fuzz_texts;

fuzz_texts fuzz_split(const uint8_t *data, size_t size);
void fuzz_texts_dispose(fuzz_texts *t);

/* Makes the length and the checksums of a container (sdm/internal/container.h) right where its
 * table leads into bytes[size]. */
void fuzz_repair_container(uint8_t *bytes, size_t size);

/* Demands that an error comes with a message and is none of the program's own. */
void fuzz_check_status(sdm_status s, const sdm_error *err);

/* Demands that a mesh is what its readers promise: indices of vertices, finite coordinates. */
void fuzz_check_mesh(const sdm_mesh *mesh);

#endif
