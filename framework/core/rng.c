/* Philox4x32-10 (Salmon et al. 2011), and random numbers of several distributions from its bits. */
#include "sdm/internal/rng.h"

#include <math.h>

void sdm_rng_block(uint64_t seed, uint64_t stream, uint64_t index, uint32_t out[4])
{
    uint32_t c[4] = {(uint32_t)index, (uint32_t)(index >> 32), (uint32_t)stream,
                     (uint32_t)(stream >> 32)};
    uint32_t k0 = (uint32_t)seed, k1 = (uint32_t)(seed >> 32);
    for (int round = 0; round < 10; round++) {
        const uint64_t a = (uint64_t)0xD2511F53u * c[0], b = (uint64_t)0xCD9E8D57u * c[2];
        const uint32_t c0 = (uint32_t)(b >> 32) ^ c[1] ^ k0, c2 = (uint32_t)(a >> 32) ^ c[3] ^ k1;
        c[1] = (uint32_t)b, c[3] = (uint32_t)a, c[0] = c0, c[2] = c2;
        k0 += 0x9E3779B9u, k1 += 0xBB67AE85u;
    }
    for (int i = 0; i < 4; i++) out[i] = c[i];
}

static double unit_real(uint32_t high, uint32_t low)
{
    return (double)(((uint64_t)high << 32 | low) >> 11) * 0x1p-53;
}

double sdm_rng_uniform(uint64_t seed, uint64_t stream, uint64_t index)
{
    uint32_t r[4];
    sdm_rng_block(seed, stream, index, r);
    return unit_real(r[0], r[1]);
}

double sdm_rng_normal(uint64_t seed, uint64_t stream, uint64_t index)
{
    uint32_t r[4];
    sdm_rng_block(seed, stream, index, r);
    // u > 0, so log(u) is finite
    const double u = 1.0 - unit_real(r[0], r[1]), v = unit_real(r[2], r[3]);
    return sqrt(-2.0 * log(u)) * cos(6.283185307179586476925 * v);
}

uint64_t sdm_rng_below(uint64_t seed, uint64_t stream, uint64_t index, uint64_t n)
{
    uint32_t r[4];
    sdm_rng_block(seed, stream, index, r);
    if (n <= UINT32_MAX) return (uint64_t)r[0] * n >> 32;
    return ((uint64_t)r[0] << 32 | r[1]) % n;
}
