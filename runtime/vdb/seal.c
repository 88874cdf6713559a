/* Appends and checks the checksum at the end of a level set file. */
#include "seal.h"

#include <errno.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/checksum.h"
#include "sdm/memory.h"

#define MAGIC "sdmgenCR"
#define SEAL_BYTES 16u
#define PIECE_BYTES (1u << 20)

/* Results of one pass over a file. */
typedef struct scan {
    uint64_t crc;             // CRC-64 of all bytes except the last SEAL_BYTES
    uint64_t crc_whole;       // CRC-64 of all bytes
    uint8_t tail[SEAL_BYTES]; // the last SEAL_BYTES bytes
    size_t size;
    bool marked; // SDM_SEAL_MARK was found
} scan;

static bool holds_mark(const uint8_t *data, size_t size)
{
    const size_t n = strlen(SDM_SEAL_MARK);
    for (const uint8_t *at = data; size >= n;) {
        const uint8_t *hit = memchr(at, SDM_SEAL_MARK[0], size - n + 1);
        if (!hit) return false;
        if (!memcmp(hit, SDM_SEAL_MARK, n)) return true;
        size -= (size_t)(hit + 1 - at);
        at = hit + 1;
    }
    return false;
}

/* Reads a file piece by piece. block[PIECE_BYTES + 2 * SEAL_BYTES] is scratch memory: the last
   SEAL_BYTES bytes read are kept at its beginning, since they may be the seal, or the first part of
   a mark that continues in the next piece. */
static sdm_status scan_file(FILE *f, const char *path, uint8_t *block, scan *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    size_t held = 0;
    for (;;) {
        const size_t got = fread(block + held, 1, PIECE_BYTES, f);
        if (ferror(f)) return sdm_fail(err, SDM_E_IO, "%s: cannot read: %s", path, strerror(errno));
        if (!got) break;
        out->size += got;
        out->marked = out->marked || holds_mark(block, held + got);
        const size_t total = held + got, done = total > SEAL_BYTES ? total - SEAL_BYTES : 0;
        out->crc = sdm_crc64(out->crc, block, done);
        memmove(block, block + done, total - done);
        held = total - done;
    }
    memcpy(out->tail, block, held);
    out->crc_whole = sdm_crc64(out->crc, block, held);
    return SDM_OK;
}

static sdm_status scan_path(const char *path, scan *out, sdm_error *err)
{
    uint8_t *block = NULL;
    const sdm_status s = SDM_ALLOC(&block, PIECE_BYTES + 2 * SEAL_BYTES, "reading buffer", err);
    if (s) return s;
    FILE *f = fopen(path, "rb");
    const sdm_status t = f ? scan_file(f, path, block, out, err)
                           : sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(errno));
    if (f) fclose(f);
    sdm_free(block);
    return t;
}

sdm_status sdm_seal_append(const char *path, sdm_error *err)
{
    scan found;
    const sdm_status s = scan_path(path, &found, err);
    if (s) return s;
    uint8_t seal[SEAL_BYTES];
    memcpy(seal, MAGIC, 8);
    for (int i = 0; i < 8; i++) seal[8 + i] = (uint8_t)(found.crc_whole >> (8 * i));
    FILE *f = fopen(path, "ab");
    if (!f) return sdm_fail(err, SDM_E_IO, "%s: cannot append: %s", path, strerror(errno));
    const bool wrote = fwrite(seal, 1, sizeof seal, f) == sizeof seal;
    const bool closed = !fclose(f);
    return wrote && closed
               ? SDM_OK
               : sdm_fail(err, SDM_E_IO, "%s: cannot append: %s", path, strerror(errno));
}

sdm_status sdm_seal_check(const char *path, bool *sealed, sdm_error *err)
{
    *sealed = false;
    scan found;
    const sdm_status s = scan_path(path, &found, err);
    if (s) return s;
    const bool has_seal = found.size >= SEAL_BYTES && !memcmp(found.tail, MAGIC, 8);
    if (!has_seal && found.marked)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: damaged: the checksum at its end is missing: the file was cut, "
                        "changed or saved again by "
                        "another program",
                        path);
    if (!has_seal) return SDM_OK;
    uint64_t stored = 0;
    for (int i = 0; i < 8; i++) stored |= (uint64_t)found.tail[8 + i] << (8 * i);
    if (stored != found.crc)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: damaged: checksum of the file is %016llx, stored is %016llx", path,
                        (unsigned long long)found.crc, (unsigned long long)stored);
    *sealed = true;
    return SDM_OK;
}
