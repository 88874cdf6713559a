/* Order of points along a space-filling curve: keys, and a parallel radix sort. */
#include "point_order.h"

#include <string.h>

#define N_DIGIT ((size_t)1 << SDM_CURVE_BITS) // values of a digit of the radix sort
#define SLICES_MAX 64 // parts of the array that threads sort at the same time
#define SLICE_MIN 8192

void sdm_point_order(const double *x, size_t n, const double lo[3], const double hi[3],
                     sdm_point_keys *keys, int n_threads, sdm_point_key *key,
                     sdm_point_key *scratch)
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
        const int shift = SDM_CURVE_BITS * digit;
#pragma omp parallel for num_threads((int)n_slice) if (n_slice > 1)
        for (size_t slice = 0; slice < n_slice; slice++) {
            const size_t begin = slice * size, end = begin + size < n ? begin + size : n;
            if (digit == 0) keys(x, begin, end, lo, scale, from);
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
