/* Finds the blocks that the coefficients of a spline do not decide. The coefficients are divided
   into bins; the smallest and the largest of a bin bound the values of the spline there. */
#include "band_doubt.h"

#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "spline_kernels.h"

/* Bin b holds the coefficients BIN b .. BIN (b + 1) along each axis: neighbouring coefficients
   share a bin, so between blocks of different signs lies a mixed bin. */
enum { BIN = 4 };
_Static_assert(BIN + 1 == SPLINE_WINDOW, "a bin is a window");

/* What the coefficients of a bin show: all beyond the limit outside, all inside, or neither. */
enum { ALL_OUTSIDE = 0, MIXED = 1, ALL_INSIDE = 2 };

/* Bound on the rounding errors of a value, as a share of the largest coefficient. */
#define ROUNDING 4e-6f

typedef struct bins {
    size_t n[3];
    uint8_t *kind; /* [n[2]][n[1]][n[0]] */
} bins;

static inline float smaller(float a, float b) { return a < b ? a : b; }
static inline float larger(float a, float b) { return a > b ? a : b; }

/* The last coefficient of bin b along axis a. */
static size_t bin_last(const spline_shape *s, int a, size_t b)
{
    const size_t last = (b + 1) * BIN;
    return last < s->padded[a] ? last : s->padded[a] - 1;
}

static uint8_t kind_of(float low, float high, float limit)
{
    if (low > limit + ROUNDING * high) return ALL_OUTSIDE;
    return high < ROUNDING * low - limit ? ALL_INSIDE : MIXED;
}

/* kind[n of x] of the bins in row j of layer k. low[], high[]: memory for a row. */
static void sort_bins(const spline_shape *s, const float *c, float limit, const bins *b, size_t j,
                      size_t k, float *low, float *high)
{
    const size_t nx = s->padded[0];
    const spline_table *kernels = sdm_spline_kernels();
    const float *first = c + k * BIN * s->step[2] + j * BIN * s->step[1];
    memcpy(low, first, nx * sizeof *low);
    memcpy(high, first, nx * sizeof *high);
    for (size_t z = k * BIN; z <= bin_last(s, 2, k); z++) {
        const float *row[SPLINE_WINDOW];
        for (size_t i = 0; i <= BIN; i++) {
            const size_t y = j * BIN + i, last = bin_last(s, 1, j);
            row[i] = c + z * s->step[2] + (y < last ? y : last) * s->step[1];
        }
        kernels->extremes(row, nx, low, high);
    }
    uint8_t *kind = b->kind + (k * b->n[1] + j) * b->n[0];
    for (size_t i = 0; i < b->n[0]; i++) {
        float least = low[i * BIN], most = high[i * BIN];
        for (size_t x = i * BIN + 1; x <= bin_last(s, 0, i); x++) {
            least = smaller(low[x], least);
            most = larger(high[x], most);
        }
        kind[i] = kind_of(least, most, limit);
    }
}

static sdm_status make_bins(const spline_shape *s, const float *c, float limit, int n_threads,
                            bins *b, sdm_error *err)
{
    for (int a = 0; a < 3; a++) b->n[a] = (s->padded[a] + BIN - 2) / BIN;
    float *memory = NULL;
    const size_t nx = s->padded[0];
    sdm_status status = SDM_ALLOC(&b->kind, b->n[0] * b->n[1] * b->n[2], "bins of a band", err);
    if (!status) status = SDM_ALLOC(&memory, 2 * nx * (size_t)n_threads, "bins of a band", err);
    if (status) return status;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t k = 0; k < b->n[2]; k++) {
        float *own = memory + 2 * nx * (size_t)sdm_thread();
        for (size_t j = 0; j < b->n[1]; j++) sort_bins(s, c, limit, b, j, k, own, own + nx);
    }
    sdm_free(memory);
    return SDM_OK;
}

/* The blocks first .. last - 1 along an axis of the grid that coefficients of a bin influence. */
typedef struct block_range {
    size_t first, last;
} block_range;

/* range[bins along x->axis] for an axis of the grid. */
static void find_ranges(const spline_shape *s, const block_axis *x, size_t n_bin,
                        block_range *range)
{
    for (size_t b = 0; b < n_bin; b++) range[b] = (block_range){x->n, 0};
    for (size_t i = 0; i < x->n; i++) {
        const size_t low = x->span[i].low * SPLINE_BRICK,
                     end = x->span[i].high * SPLINE_BRICK + SPLINE_BRICK + 2,
                     high = end < s->padded[x->axis] ? end : s->padded[x->axis] - 1;
        for (size_t b = low > BIN ? (low - 1) / BIN : 0; b < n_bin && b * BIN <= high; b++) {
            range[b].first = i < range[b].first ? i : range[b].first;
            range[b].last = i + 1;
        }
    }
}

/* Adds the kinds of bins to those of the blocks that they influence. range[b]: by bins along the
   axis of the map that belongs to axis b of the grid. */
static void spread_kinds(const bins *b, const block_axis axis[3], block_range *const range[3],
                         uint8_t *kinds)
{
    size_t at[3];
    const uint8_t *kind = b->kind;
    for (at[2] = 0; at[2] < b->n[2]; at[2]++)
        for (at[1] = 0; at[1] < b->n[1]; at[1]++)
            for (at[0] = 0; at[0] < b->n[0]; at[0]++, kind++) {
                if (*kind == ALL_OUTSIDE) continue;
                const block_range x = range[0][at[axis[0].axis]], y = range[1][at[axis[1].axis]],
                                  z = range[2][at[axis[2].axis]];
                for (size_t k = z.first; k < z.last; k++)
                    for (size_t j = y.first; j < y.last; j++) {
                        uint8_t *row = kinds + (k * axis[1].n + j) * axis[0].n;
                        for (size_t i = x.first; i < x.last; i++) row[i] |= *kind;
                    }
            }
}

sdm_status sdm_band_doubt(const spline_shape *s, const float *coefficient, float limit,
                          const block_axis axis[3], int n_threads, uint8_t *doubt, sdm_error *err)
{
    bins b = {.kind = NULL};
    block_range *range[3] = {NULL};
    sdm_status status = make_bins(s, coefficient, limit, n_threads, &b, err);
    if (!status) status = SDM_ALLOC(&range[0], b.n[0] + b.n[1] + b.n[2], "blocks of bins", err);
    if (!status) {
        range[1] = range[0] + b.n[axis[0].axis];
        range[2] = range[1] + b.n[axis[1].axis];
        for (int a = 0; a < 3; a++) find_ranges(s, &axis[a], b.n[axis[a].axis], range[a]);
        memset(doubt, 0, axis[0].n * axis[1].n * axis[2].n);
        spread_kinds(&b, axis, range, doubt);
        // outside of the box the bound is positive, even where the map is negative at its edge
        for (size_t k = 0; k < axis[2].n; k++)
            for (size_t j = 0; j < axis[1].n; j++) {
                const bool leaves = axis[2].span[k].leaves || axis[1].span[j].leaves;
                for (size_t i = 0; i < axis[0].n; i++, doubt++)
                    *doubt = *doubt & MIXED ||
                             (*doubt == ALL_INSIDE && (leaves || axis[0].span[i].leaves));
            }
    }
    sdm_free(range[0]);
    sdm_free(b.kind);
    return status;
}
