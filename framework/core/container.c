/* Builds, writes and parses the container: the file format of models and checkpoints. */
#include "sdm/internal/container.h"

#include <string.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

static const char magic[8] = {'S', 'D', 'M', 'G', 'E', 'N', '\r', '\n'};

enum { HEADER_BYTES = 24, ENTRY_BYTES = 48, NAME_BYTES = 24, ALIGN = 64 };

// little-endian integers of 1 to 8 bytes
static void store_le(uint8_t *p, uint64_t v, int bytes)
{
    for (int i = 0; i < bytes; i++) p[i] = (uint8_t)(v >> (8 * i));
}

static uint64_t load_le(const uint8_t *p, int bytes)
{
    uint64_t v = 0;
    for (int i = bytes - 1; i >= 0; i--) v = v << 8 | p[i];
    return v;
}

static size_t round_up(size_t n) { return (n + ALIGN - 1) / ALIGN * ALIGN; }

sdm_status sdm_container_build(const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                               sdm_error *err)
{
    *bytes = NULL;
    if (n < 1 || n > SDM_CONTAINER_MAX_SECTIONS)
        return sdm_fail(err, SDM_E_INTERNAL, "%zu sections, need 1 to %u", n,
                        SDM_CONTAINER_MAX_SECTIONS);

    // length of the file
    const size_t table_end = HEADER_BYTES + n * ENTRY_BYTES;
    size_t total = round_up(table_end + 8);
    for (size_t i = 0; i < n; i++) {
        if (strlen(sections[i].name) >= NAME_BYTES)
            return sdm_fail(err, SDM_E_INTERNAL, "section name '%s' is too long", sections[i].name);
        if (sections[i].size > SIZE_MAX / 4 - total)
            return sdm_fail(err, SDM_E_NOMEM, "sections are more than memory can hold");
        total = round_up(total + sections[i].size);
    }
    total += 8;
    uint8_t *p = NULL;
    const sdm_status s = SDM_ALLOC(&p, total, "model file", err);
    if (s) return s;

    // header
    memcpy(p, magic, sizeof magic);
    store_le(p + 8, SDM_CONTAINER_VERSION, 4);
    store_le(p + 12, n, 4);
    store_le(p + 16, total, 8);

    // sections and their table
    size_t at = round_up(table_end + 8);
    for (size_t i = 0; i < n; i++) {
        uint8_t *entry = p + HEADER_BYTES + i * ENTRY_BYTES;
        memcpy(entry, sections[i].name, strlen(sections[i].name));
        store_le(entry + 24, at, 8);
        store_le(entry + 32, sections[i].size, 8);
        store_le(entry + 40, sdm_crc64(0, sections[i].data, sections[i].size), 8);
        if (sections[i].size) memcpy(p + at, sections[i].data, sections[i].size);
        at = round_up(at + sections[i].size);
    }

    // checksums of the header with the table, and of the whole file
    store_le(p + table_end, sdm_crc64(0, p, table_end), 8);
    store_le(p + total - 8, sdm_crc64(0, p, total - 8), 8);
    *bytes = p;
    *size = total;
    return SDM_OK;
}

sdm_status sdm_container_write(const char *path, const uint8_t *bytes, size_t size, sdm_error *err)
{
    sdm_outfile *f;
    sdm_status s = sdm_outfile_open(path, &f, err);
    if (s) return s;
    s = sdm_outfile_write(f, bytes, size, err);
    if (!s) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return s;
}

sdm_status sdm_container_places(const uint8_t *head, uint64_t size, sdm_section_place *places,
                                size_t *n, sdm_error *err)
{
    // header
    if (size < sizeof magic || memcmp(head, magic, sizeof magic))
        return sdm_fail(err, SDM_E_FORMAT,
                        "not a model file (it does not begin with the signature SDMGEN)");
    if (size < HEADER_BYTES + ENTRY_BYTES + 16)
        return sdm_fail(err, SDM_E_FORMAT, "truncated: only %llu bytes", (unsigned long long)size);
    const uint64_t version = load_le(head + 8, 4), count = load_le(head + 12, 4),
                   length = load_le(head + 16, 8);
    if (version > SDM_CONTAINER_VERSION && version < 1000)
        return sdm_fail(
            err, SDM_E_FORMAT,
            "format version %llu is newer than %u, which this program reads: update sdmgen",
            (unsigned long long)version, SDM_CONTAINER_VERSION);
    if (version > 0 && version < SDM_CONTAINER_VERSION)
        return sdm_fail(err, SDM_E_FORMAT,
                        "format version %llu is from before the first release: train again",
                        (unsigned long long)version);
    if (version != SDM_CONTAINER_VERSION)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: format version %llu",
                        (unsigned long long)version);

    // sizes, checksum of the header
    if (length != size)
        return sdm_fail(err, SDM_E_FORMAT, "%s: it has %llu bytes, its header gives %llu",
                        size < length ? "truncated" : "damaged", (unsigned long long)size,
                        (unsigned long long)length);
    if (count < 1 || count > SDM_CONTAINER_MAX_SECTIONS)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %llu sections", (unsigned long long)count);
    const size_t table_end = HEADER_BYTES + (size_t)count * ENTRY_BYTES;
    if (table_end + 16 > size)
        return sdm_fail(err, SDM_E_FORMAT, "truncated: the table of sections is not complete");
    if (load_le(head + table_end, 8) != sdm_crc64(0, head, table_end))
        return sdm_fail(err, SDM_E_FORMAT, "damaged: the checksum of the header is wrong");

    // sections: aligned, in ascending order without overlap, inside the file
    uint64_t end = table_end + 8;
    for (size_t i = 0; i < count; i++) {
        const uint8_t *entry = head + HEADER_BYTES + i * ENTRY_BYTES;
        sdm_section_place *p = &places[i];
        p->at = load_le(entry + 24, 8), p->size = load_le(entry + 32, 8);
        p->checksum = load_le(entry + 40, 8);
        memcpy(p->name, entry, NAME_BYTES);
        if (p->name[NAME_BYTES - 1])
            return sdm_fail(err, SDM_E_FORMAT, "damaged: the name of section %zu does not end", i);
        if (p->at % ALIGN || p->at < end || p->at > size - 8 || p->size > size - 8 - p->at)
            return sdm_fail(err, SDM_E_FORMAT, "damaged: section '%s' lies outside the file",
                            p->name);
        end = p->at + p->size;
    }
    *n = (size_t)count;
    return SDM_OK;
}

sdm_status sdm_container_parse(const uint8_t *bytes, size_t size, sdm_section *sections,
                               char names[SDM_CONTAINER_MAX_SECTIONS][24], size_t *n,
                               uint64_t *checksum, sdm_error *err)
{
    sdm_section_place places[SDM_CONTAINER_MAX_SECTIONS];
    size_t count;
    const sdm_status s = sdm_container_places(bytes, size, places, &count, err);
    if (s) return s;
    for (size_t i = 0; i < count; i++) {
        const sdm_section_place *p = &places[i];
        memcpy(names[i], p->name, NAME_BYTES);
        if (p->checksum != sdm_crc64(0, bytes + p->at, (size_t)p->size))
            return sdm_fail(err, SDM_E_FORMAT, "damaged: the checksum of section '%s' is wrong",
                            names[i]);
        sections[i] = (sdm_section){names[i], bytes + p->at, (size_t)p->size};
    }
    *checksum = load_le(bytes + size - 8, 8);
    if (*checksum != sdm_crc64(0, bytes, size - 8))
        return sdm_fail(err, SDM_E_FORMAT, "damaged: the checksum of the file is wrong");
    *n = count;
    return SDM_OK;
}
