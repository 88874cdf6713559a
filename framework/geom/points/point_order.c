/* Order of points along a space-filling curve: keys, and a parallel radix sort. */
#include "point_order.h"

#include <string.h>

#define BITS 10                    // bits of a coordinate, and of a digit of the radix sort
#define N_DIGIT ((size_t)1 << BITS) // values of a digit
#define N_PART 16                  // points whose keys are computed together
#define SLICES_MAX 64              // parts of the array that threads sort at the same time
#define SLICE_MIN 8192

/* Spreads the lowest ten bits to every third bit. */
static inline uint32_t bits_spread(uint32_t x)
{
    x = (x | x << 16) & 0x030000ffu;
    x = (x | x << 8) & 0x0300f00fu;
    x = (x | x << 4) & 0x030c30c3u;
    return (x | x << 2) & 0x09249249u;
}

/* Places on the Hilbert curve of N_PART cells with the coordinates c[axis][i] < 2^BITS. The loops
   over i are free of branches, so that compilers use SIMD. */
static void hilbert_places(uint32_t c[3][N_PART], uint32_t place[N_PART])
{
    for (int bit = BITS - 1; bit > 0; bit--) {
        const uint32_t low = ((uint32_t)1 << bit) - 1;
        for (int a = 0; a < 3; a++) {
            for (int i = 0; i < N_PART; i++) {
                // invert the low bits of axis 0 where the bit is set, else exchange them
                const uint32_t set = 0 - (c[a][i] >> bit & 1);
                const uint32_t swap = (c[0][i] ^ c[a][i]) & low & ~set;
                c[0][i] ^= (low & set) | swap;
                c[a][i] ^= swap;
            }
        }
    }
    for (int i = 0; i < N_PART; i++) {
        // Gray code
        const uint32_t x = c[0][i], y = c[1][i] ^ x;
        uint32_t z = c[2][i] ^ y, flip = 0;
        for (int bit = BITS - 1; bit > 0; bit--)
            flip ^= (0 - (z >> bit & 1)) & (((uint32_t)1 << bit) - 1);
        z ^= flip;
        place[i] = bits_spread(x ^ flip) << 2 | bits_spread(y ^ flip) << 1 | bits_spread(z);
    }
}

/* Keys of the points begin ... end - 1. */
static void keys_set(const double *x, size_t begin, size_t end, const double lo[3],
                     const double scale[3], sdm_point_key *key)
{
    const double last = N_DIGIT - 1;
    for (size_t first = begin; first < end; first += N_PART) {
        const size_t n = end - first < N_PART ? end - first : N_PART;
        uint32_t c[3][N_PART] = {{0}}, place[N_PART];
        for (size_t i = 0; i < n; i++) {
            for (size_t a = 0; a < 3; a++) {
                const double at = (x[3 * (first + i) + a] - lo[a]) * scale[a];
                // 0 also for NaN
                c[a][i] = (uint32_t)(at > 0 ? at < last ? at : last : 0);
            }
        }
        hilbert_places(c, place);
        for (size_t i = 0; i < n; i++)
            key[first + i] = (sdm_point_key){place[i], (uint32_t)(first + i)};
    }
}

void sdm_point_order(const double *x, size_t n, const double lo[3], const double hi[3],
                     int n_threads, sdm_point_key *key, sdm_point_key *scratch)
{
    size_t count[SLICES_MAX][N_DIGIT];
    double scale[3];
    for (int a = 0; a < 3; a++) scale[a] = hi[a] > lo[a] ? (double)N_DIGIT / (hi[a] - lo[a]) : 0;
    size_t n_slice = n / SLICE_MIN < (size_t)n_threads ? n / SLICE_MIN : (size_t)n_threads;
    n_slice = n_slice < 1 ? 1 : n_slice > SLICES_MAX ? SLICES_MAX : n_slice;
    const size_t size = (n + n_slice - 1) / n_slice;
    sdm_point_key *from = scratch, *to = key;
    // three digits, the lowest first: the last pass writes to key[]
    for (int digit = 0; digit < 3; digit++) {
        const int shift = BITS * digit;
#pragma omp parallel for num_threads((int)n_slice) if (n_slice > 1)
        for (size_t slice = 0; slice < n_slice; slice++) {
            const size_t begin = slice * size, end = begin + size < n ? begin + size : n;
            if (digit == 0) keys_set(x, begin, end, lo, scale, from);
            memset(count[slice], 0, sizeof count[slice]);
            for (size_t i = begin; i < end; i++)
                count[slice][from[i].place >> shift & (N_DIGIT - 1)]++;
        }
        size_t sum = 0;
        for (size_t value = 0; value < N_DIGIT; value++) {
            for (size_t slice = 0; slice < n_slice; slice++) {
                const size_t own = count[slice][value];
                count[slice][value] = sum;
                sum += own;
            }
        }
#pragma omp parallel for num_threads((int)n_slice) if (n_slice > 1)
        for (size_t slice = 0; slice < n_slice; slice++) {
            const size_t begin = slice * size, end = begin + size < n ? begin + size : n;
            for (size_t i = begin; i < end; i++)
                to[count[slice][from[i].place >> shift & (N_DIGIT - 1)]++] = from[i];
        }
        sdm_point_key *swap = from;
        from = to;
        to = swap;
    }
}
