/* Random parameters of shapes: Sobol' points, or independent random numbers in high dimensions. */
#include <stdint.h>

#include "sdm/internal/rng.h"
#include "sdm/internal/train.h"

#define DIMENSIONS 16
#define BITS 32

/* Primitive polynomials and initial direction numbers of Joe and Kuo (2008) for dimensions 2
   to 16. */
static const struct {
    uint8_t degree, polynomial, m[6];
} joe_kuo[DIMENSIONS - 1] = {
    {1, 0, {1}},
    {2, 1, {1, 3}},
    {3, 1, {1, 3, 1}},
    {3, 2, {1, 1, 1}},
    {4, 1, {1, 1, 3, 3}},
    {4, 4, {1, 3, 5, 13}},
    {5, 2, {1, 1, 5, 5, 17}},
    {5, 4, {1, 1, 5, 5, 5}},
    {5, 7, {1, 1, 7, 11, 19}},
    {5, 11, {1, 1, 5, 1, 1}},
    {5, 13, {1, 1, 1, 3, 11}},
    {5, 14, {1, 3, 5, 5, 31}},
    {6, 1, {1, 3, 3, 9, 7, 49}},
    {6, 13, {1, 1, 1, 15, 21, 21}},
    {6, 16, {1, 3, 1, 13, 27, 49}},
};

/* Component d of Sobol' point `index`, as a 32-bit fraction. */
static uint32_t sobol(uint64_t index, size_t d)
{
    // direction numbers v by the recurrence of the primitive polynomial
    uint32_t v[BITS], out = 0;
    if (d == 0) {
        for (int i = 0; i < BITS; i++) v[i] = UINT32_C(1) << (31 - i);
    } else {
        const int s = joe_kuo[d - 1].degree, a = joe_kuo[d - 1].polynomial;
        for (int i = 0; i < s; i++) v[i] = (uint32_t)joe_kuo[d - 1].m[i] << (31 - i);
        for (int i = s; i < BITS; i++) {
            v[i] = v[i - s] ^ (v[i - s] >> s);
            for (int k = 1; k < s; k++)
                if (a >> (s - 1 - k) & 1) v[i] ^= v[i - k];
        }
    }
    for (int i = 0; i < BITS; i++)
        if (index >> i & 1) out ^= v[i];
    return out;
}

void sdm_sample_params(uint64_t seed, uint64_t stream, uint64_t index, const double *min,
                       const double *max, size_t n, double *p)
{
    for (size_t d = 0; d < n; d++) {
        double u;
        if (n <= DIMENSIONS && index <= UINT32_MAX) {
            // digital shift: exclusive or with one random number per dimension
            uint32_t shift[4];
            sdm_rng_block(seed, stream, d, shift);
            u = ((double)(sobol(index, d) ^ shift[0]) + 0.5) * 0x1p-32;
        } else {
            u = sdm_rng_uniform(seed, stream, index * n + d);
        }
        p[d] = min[d] + (max[d] - min[d]) * u;
    }
}
