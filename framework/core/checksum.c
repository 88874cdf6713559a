/* CRC-64/XZ, computed eight bytes at a time ("slicing by 8", Kounavis and Berry 2005). */
#include "sdm/internal/checksum.h"

#include "once.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

static uint64_t table[8][256];
static sdm_once once = SDM_ONCE_INIT;

static void table_fill(void)
{
    for (unsigned i = 0; i < 256; i++) {
        uint64_t c = i;
        for (int bit = 0; bit < 8; bit++) c = (c >> 1) ^ ((c & 1) ? 0xC96C5795D7870F42u : 0);
        table[0][i] = c;
    }
    for (int k = 1; k < 8; k++)
        for (unsigned i = 0; i < 256; i++)
            table[k][i] = table[0][table[k - 1][i] & 255] ^ (table[k - 1][i] >> 8);
}

uint64_t sdm_crc64(uint64_t crc, const void *data, size_t size)
{
    sdm_once_run(&once, table_fill);
    const uint8_t *p = data;
    crc = ~crc;
    for (; size >= 8; size -= 8, p += 8) {
        uint64_t w = 0;
        // load 8 bytes in little-endian order, on any machine
        for (int i = 7; i >= 0; i--) w = w << 8 | p[i];
        crc ^= w;
        uint64_t next = 0;
        for (int i = 0; i < 8; i++) next ^= table[7 - i][(crc >> (8 * i)) & 255];
        crc = next;
    }
    while (size--) crc = table[0][(crc ^ *p++) & 255] ^ (crc >> 8);
    return ~crc;
}

uint64_t sdm_content_checksum(const void *data, size_t size)
{
    const uint64_t crc = sdm_crc64(0, data, size);
    if (crc != SDM_CRC64_WITH_OWN || size < 8) return crc;
    const uint8_t *end = (const uint8_t *)data + size;
    uint64_t own = 0;
    for (int i = 1; i <= 8; i++) own = own << 8 | end[-i];
    return own;
}

sdm_status sdm_file_checksum(const char *path, uint64_t *crc, sdm_error *err)
{
    uint8_t *data;
    size_t size;
    const sdm_status s = sdm_file_read(path, UINT64_MAX, &data, &size, err);
    if (!s) *crc = sdm_content_checksum(data, size);
    sdm_free(data);
    return s;
}
