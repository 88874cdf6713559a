/* damage_vdb IN OUT POSITION BITS: copies the level set file IN to OUT, flips BITS of the byte at
 * POSITION, and makes the checksum at its end right again, as a program would that was meant to do
 * harm. For the tests of the command line. */
#include <stdio.h>
#include <stdlib.h>

#include "sdm/internal/checksum.h"

int main(int argc, char **argv)
{
    static unsigned char data[1 << 20];
    FILE *in = argc == 5 ? fopen(argv[1], "rb") : NULL;
    if (!in) return 2;
    const size_t n = fread(data, 1, sizeof data, in);
    fclose(in);
    const size_t at = (size_t)strtoul(argv[3], NULL, 10);
    if (n < 16 || n == sizeof data || at + 16 >= n) return 2;
    data[at] ^= (unsigned char)strtoul(argv[4], NULL, 10);
    const uint64_t crc = sdm_crc64(0, data, n - 16);
    for (int i = 0; i < 8; i++) data[n - 8 + (size_t)i] = (unsigned char)(crc >> 8 * i);
    FILE *out = fopen(argv[2], "wb");
    if (!out || fwrite(data, 1, n, out) != n) return 2;
    return fclose(out) ? 2 : 0;
}
