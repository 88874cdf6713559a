/* What the fuzz targets share: copies, files, texts, containers with right checksums. */
#include "fuzz_reader.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "sdm/internal/checksum.h"

void fuzz_require(int holds)
{
    if (!holds) abort();
}

uint8_t *fuzz_copy(const uint8_t *data, size_t size)
{
    void *block = NULL;
    fuzz_require(!posix_memalign(&block, 64, size ? size : 1));
    if (size) memcpy(block, data, size);
    return block;
}

static char folder[256], last_file[512];

static void remove_folder(void)
{
    if (*last_file) unlink(last_file);
    rmdir(folder);
}

const char *fuzz_folder(void)
{
    if (*folder) return folder;
    const char *parent = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%.200s/fuzz_XXXXXX", parent ? parent : "/tmp");
    fuzz_require(mkdtemp(folder) != NULL && !atexit(remove_folder));
    return folder;
}

const char *fuzz_file(const char *name, const uint8_t *data, size_t size)
{
    snprintf(last_file, sizeof last_file, "%s/%.100s", fuzz_folder(), name);
    FILE *f = fopen(last_file, "wb");
    fuzz_require(f != NULL);
    fuzz_require(fwrite(data, 1, size, f) == size);
    fuzz_require(!fclose(f));
    return last_file;
}

fuzz_texts fuzz_split(const uint8_t *data, size_t size)
{
    fuzz_texts t = {.all = malloc(size + 1)};
    fuzz_require(t.all != NULL);
    if (size) memcpy(t.all, data, size);
    t.all[size] = 0;
    char *end = memchr(t.all, 1, size);
    t.file_size = end ? (size_t)(end - t.all) : size;
    t.file = (char *)fuzz_copy(data, t.file_size);
    for (; end && t.n_overrides < FUZZ_OVERRIDES_MAX; end = strchr(end, 1)) {
        *end++ = 0;
        t.overrides[t.n_overrides++] = end;
    }
    return t;
}

void fuzz_texts_dispose(fuzz_texts *t)
{
    free(t->file);
    free(t->all);
}

static uint64_t load_le(const uint8_t *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--) v = v << 8 | p[i];
    return v;
}

static void store_le(uint8_t *p, uint64_t v)
{
    for (int i = 0; i < 8; i++) p[i] = (uint8_t)(v >> (8 * i));
}

void fuzz_repair_container(uint8_t *bytes, size_t size)
{
    enum { HEADER = 24, ENTRY = 48 };
    if (size < HEADER + ENTRY + 16) return;
    store_le(bytes + 16, size);
    const uint64_t n = load_le(bytes + 12, 4);
    if (n > (size - HEADER - 16) / ENTRY) return;
    for (uint8_t *entry = bytes + HEADER; entry < bytes + HEADER + n * ENTRY; entry += ENTRY) {
        const uint64_t at = load_le(entry + 24, 8), length = load_le(entry + 32, 8);
        if (at <= size - 8 && length <= size - 8 - at)
            store_le(entry + 40, sdm_crc64(0, bytes + at, (size_t)length));
    }
    const size_t table_end = HEADER + (size_t)n * ENTRY;
    store_le(bytes + table_end, sdm_crc64(0, bytes, table_end));
    store_le(bytes + size - 8, sdm_crc64(0, bytes, size - 8));
}

void fuzz_check_status(sdm_status s, const sdm_error *err)
{
    fuzz_require(s == SDM_OK || err->text[0]);
    fuzz_require(s != SDM_E_INTERNAL);
}

void fuzz_check_mesh(const sdm_mesh *mesh)
{
    for (size_t i = 0; i < 3 * mesh->n_vert; i++) fuzz_require(isfinite(mesh->vert[i]));
    for (size_t i = 0; i < 3 * mesh->n_tri; i++) fuzz_require(mesh->tri[i] < mesh->n_vert);
}
