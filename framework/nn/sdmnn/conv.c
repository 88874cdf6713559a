/* Convolution of feature maps: packing of weights, loops around the kernels, gradient by the
 * weights.
 */
#include "conv.h"

#include <string.h>

#include "conv_kernels.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/threads.h"

enum {
    GROUP = 32,          // output channels in a unit of work, a multiple of every mr
    GRADIENT_TERMS = 54, // terms in a unit of work of the gradient, a multiple of 3
    MR_MAX = 8,          // largest conv_table.mr
    SMALL_MAX = 256,     // largest number of positions of a small feature map
    SMALL_CHUNK = 128    // positions of a small feature map in one matrix product
};

static const conv_table *conv_kernels(void)
{
#if defined(__x86_64__)
    const char *isa = sdm_kernels_name();
    if (!strncmp(isa, "avx512", 6)) return &sdm_conv_avx512;
    if (!strcmp(isa, "avx2")) return &sdm_conv_avx2;
#endif
    return &sdm_conv_generic;
}

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }
static size_t divide_up(size_t a, size_t b) { return (a + b - 1) / b; }

static int thread_count(int wanted, size_t units)
{
    const int n = sdm_threads(wanted);
    return (size_t)n < units ? n : (int)units;
}

// offset[i] = (index of the input of term k0 + i) - (position of the output), for i < n. The number
// of a term is channel * taps + tap.
static void offsets(const sdm_fmap *g, size_t taps, size_t k0, size_t n, ptrdiff_t *offset)
{
    ptrdiff_t shift[27] = {0};
    for (int t = 0; t < 27 && taps == 27; t++)
        shift[t] =
            (t / 9 - 1) * (ptrdiff_t)g->plane + (t / 3 % 3 - 1) * (ptrdiff_t)g->row + t % 3 - 1;
    size_t tap = k0 % taps;
    ptrdiff_t channel = (ptrdiff_t)(k0 / taps * g->stride);
    for (size_t i = 0; i < n; i++) {
        offset[i] = channel + shift[tap];
        if (++tap == taps) tap = 0, channel += (ptrdiff_t)g->stride;
    }
}

size_t sdm_conv_packed_count(sdm_conv c)
{
    const size_t mr = conv_kernels()->mr;
    return divide_up(c.out, mr) * mr * c.in * c.taps;
}

// The layout is packed[blocks of SDM_CONV_TERMS terms][tiles of output channels][terms][mr], with
// zeros beyond the last output channel.
void sdm_conv_pack(sdm_conv c, bool transposed, const float *w, float *packed)
{
    const size_t mr = conv_kernels()->mr;
    const sdm_conv to = transposed ? sdm_conv_opposite(c) : c;
    const size_t terms = to.in * to.taps;
    for (size_t k0 = 0; k0 < terms; k0 += SDM_CONV_TERMS) {
        const size_t k1 = min_size(terms, k0 + SDM_CONV_TERMS);
        for (size_t o0 = 0; o0 < to.out; o0 += mr) {
            for (size_t k = k0; k < k1; k++) {
                const size_t i = k / c.taps, tap = k % c.taps;
                for (size_t o = o0; o < o0 + mr; o++) {
                    const size_t from = transposed ? (i * c.in + o) * c.taps + c.taps - 1 - tap
                                                   : (o * c.in + i) * c.taps + tap;
                    *packed++ = o < to.out ? w[from] : 0.0f;
                }
            }
        }
    }
}

// Computes a tile that reaches beyond the last output channel or position as a full tile, and
// stores the rows x cols elements that exist.
static void edge_tile(const conv_table *t, size_t k, const float *a, const float *x,
                      const ptrdiff_t *offset, float *y, size_t ldy, size_t rows, size_t cols,
                      int add)
{
    float edge[MR_MAX * SDM_CONV_NR_MAX] = {0};
    for (size_t i = 0; i < rows && add; i++)
        memcpy(edge + i * t->nr, y + i * ldy, cols * sizeof *y);
    t->tile(k, a, x, offset, edge, t->nr, add);
    for (size_t i = 0; i < rows; i++) memcpy(y + i * ldy, edge + i * t->nr, cols * sizeof *y);
}

// Computes output channels o0 .. o1 - 1 (o0 is a multiple of mr) at positions p0 .. p1 - 1.
static void chunk_convolve(const conv_table *t, const sdm_fmap *g, sdm_conv c, const float *packed,
                           const float *x, float *y, size_t o0, size_t o1, size_t p0, size_t p1)
{
    const size_t terms = c.in * c.taps, padded = divide_up(c.out, t->mr) * t->mr;
    ptrdiff_t offset[SDM_CONV_TERMS];
    for (size_t k0 = 0; k0 < terms; k0 += SDM_CONV_TERMS) {
        const size_t k = min_size(SDM_CONV_TERMS, terms - k0);
        const float *weights = packed + k0 * padded;
        offsets(g, c.taps, k0, k, offset);
        for (size_t p = p0; p < p1; p += t->nr) {
            for (size_t o = o0; o < o1; o += t->mr) {
                float *at = y + o * g->stride + p;
                const float *a = weights + o * k;
                const size_t rows = min_size(t->mr, o1 - o), cols = min_size(t->nr, p1 - p);
                if (rows == t->mr && cols == t->nr)
                    t->tile(k, a, x + p, offset, at, g->stride, k0 > 0);
                else
                    edge_tile(t, k, a, x + p, offset, at, g->stride, rows, cols, k0 > 0);
            }
        }
    }
}

// applies f to channel o at positions p0 .. p1 - 1 and clears the padding
static void finish_chunk(const sdm_fmap *g, sdm_conv_finish f, float *y, size_t o, size_t p0,
                         size_t p1)
{
    float *channel = y + o * g->stride, *slope = f.slope ? f.slope + o * g->stride : NULL;
    if (f.bias)
        for (size_t p = p0; p < p1; p++) channel[p] += f.bias[o];
    if (f.activation >= 0)
        sdm_activate(f.activation, p1 - p0, channel + p0, channel + p0, slope ? slope + p0 : NULL);
    sdm_fmap_clear_pads(g, p0, p1, channel);
    if (slope) sdm_fmap_clear_pads(g, p0, p1, slope);
}

void sdm_conv_apply(const sdm_fmap *g, sdm_conv c, const float *packed, const float *x,
                    sdm_conv_finish finish, float *y, int n_threads)
{
    const conv_table *t = conv_kernels();
    const size_t chunks = divide_up(g->count, SDM_CONV_CHUNK), groups = divide_up(c.out, GROUP);
    n_threads = thread_count(n_threads, chunks * groups);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads) if (n_threads > 1)
    for (long unit = 0; unit < (long)(chunks * groups); unit++) {
        const size_t p0 = (size_t)unit % chunks * SDM_CONV_CHUNK,
                     p1 = min_size(g->count, p0 + SDM_CONV_CHUNK);
        const size_t o0 = (size_t)unit / chunks * GROUP, o1 = min_size(c.out, o0 + GROUP);
        chunk_convolve(t, g, c, packed, x, y, o0, o1, p0, p1);
        for (size_t o = o0; o < o1; o++) finish_chunk(g, finish, y, o, p0, p1);
    }
}

static float sum_lanes(const float *v, size_t width)
{
    float s = 0;
    for (size_t j = 0; j < width; j += 4) s += (v[j] + v[j + 1]) + (v[j + 2] + v[j + 3]);
    return s;
}

void sdm_conv_finish_maps(const sdm_fmap *g, size_t channels, sdm_conv_finish finish, float *y,
                          int n_threads)
{
    n_threads = thread_count(n_threads, channels);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long o = 0; o < (long)channels; o++) finish_chunk(g, finish, y, (size_t)o, 0, g->count);
}

// Adds to dw for mr output channels from o on and GRADIENT_TERMS terms from k0 on; sums over all
// positions.
static void gradient_unit(const conv_table *t, const sdm_fmap *g, sdm_conv c, const float *x,
                          const float *dy, float *dw, size_t o, size_t k0)
{
    const size_t terms = c.in * c.taps, k = min_size(GRADIENT_TERMS, terms - k0),
                 rows = min_size(t->mr, c.out - o);
    const size_t tile = 3 * t->mr * t->width; // partial sums of one call of dot()
    // positions, rounded up to whole registers: dy is zero beyond the last one
    const size_t count = divide_up(g->count, t->width) * t->width;
    ptrdiff_t offset[GRADIENT_TERMS + 2];
    float sums[(GRADIENT_TERMS / 3) * SDM_CONV_SUMS_MAX], copy[MR_MAX * SDM_CONV_CHUNK];
    memset(sums, 0, divide_up(k, 3) * tile * sizeof *sums);
    offsets(g, c.taps, k0, k, offset);
    // dot() computes three terms: after the last term, sums are computed that are not used
    for (size_t i = k; i < k + 2; i++) offset[i] = offset[k - 1];

    // partial sums in the lanes of registers
    for (size_t p = 0; p < count; p += SDM_CONV_CHUNK) {
        const size_t n = min_size(SDM_CONV_CHUNK, count - p);
        const float *d = dy + o * g->stride + p;
        size_t ldy = g->stride;
        if (rows < t->mr) { // use a copy with zeros for the missing channels
            memset(copy, 0, sizeof copy);
            for (size_t i = 0; i < rows; i++)
                memcpy(copy + i * SDM_CONV_CHUNK, d + i * ldy, n * sizeof *d);
            d = copy, ldy = SDM_CONV_CHUNK;
        }
        for (size_t i = 0; i < k; i += 3) t->dot(n, d, ldy, x + p, offset + i, sums + i / 3 * tile);
    }

    // sums over the lanes
    for (size_t r = 0; r < rows; r++) {
        float *to = dw + (o + r) * terms + k0;
        for (size_t i = 0; i < k; i++)
            to[i] += sum_lanes(sums + i / 3 * tile + (r * 3 + i % 3) * t->width, t->width);
    }
}

// Adds to dw for all output channels and SDM_CONV_TERMS terms from k0 on, by a matrix product of dy
// and the shifted inputs. For small feature maps: in gradient_unit() the sums over the lanes would
// dominate.
static void gradient_small(const sdm_fmap *g, sdm_conv c, const float *x, const float *dy,
                           float *dw, size_t k0)
{
    const size_t terms = c.in * c.taps, k = min_size(SDM_CONV_TERMS, terms - k0);
    ptrdiff_t offset[SDM_CONV_TERMS];
    float columns[SDM_CONV_TERMS * SMALL_CHUNK];
    offsets(g, c.taps, k0, k, offset);
    for (size_t p = 0; p < g->count; p += SMALL_CHUNK) {
        const size_t n = min_size(SMALL_CHUNK, g->count - p);
        for (size_t i = 0; i < k; i++) memcpy(columns + i * n, x + p + offset[i], n * sizeof *x);
        sdm_gemm(c.out, k, n, (sdm_view){dy + p, g->stride, 1}, (sdm_view){columns, 1, n}, true,
                 dw + k0, terms, 1);
    }
}

// sum of v[n], in float over runs of 4096 elements and in double over the runs
static float sum_of(size_t n, const float *v)
{
    enum { LANES = 16, RUN = 4096 };
    double total = 0;
    for (size_t at = 0; at < n; at += RUN) {
        const size_t end = min_size(n, at + RUN);
        float lane[LANES] = {0};
        size_t i = at;
        for (; i + LANES <= end; i += LANES)
            for (size_t j = 0; j < LANES; j++) lane[j] += v[i + j];
        for (; i < end; i++) lane[0] += v[i];
        for (size_t j = 0; j < LANES; j++) total += (double)lane[j];
    }
    return (float)total;
}

void sdm_conv_gradient(const sdm_fmap *g, sdm_conv c, const float *x, const float *dy, float *dw,
                       float *db, int n_threads)
{
    const conv_table *t = conv_kernels();
    const bool small = g->count <= SMALL_MAX;
    const size_t panels = small ? 1 : divide_up(c.out, t->mr);
    const size_t units = panels * divide_up(c.in * c.taps, small ? SDM_CONV_TERMS : GRADIENT_TERMS);
    n_threads = thread_count(n_threads, units);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads) if (n_threads > 1)
    for (long i = 0; i < (long)(units + c.out); i++) {
        const size_t unit = (size_t)i;
        if (unit >= units)
            db[unit - units] += sum_of(g->count, dy + (unit - units) * g->stride);
        else if (small)
            gradient_small(g, c, x, dy, dw, unit * SDM_CONV_TERMS);
        else
            gradient_unit(t, g, c, x, dy, dw, unit % panels * t->mr,
                          unit / panels * GRADIENT_TERMS);
    }
}

const sdm_conv_backend *sdm_conv_native(void)
{
    static const sdm_conv_backend native = {.name = "native",
                                            .packed_count = sdm_conv_packed_count,
                                            .pack = sdm_conv_pack,
                                            .apply = sdm_conv_apply,
                                            .gradient = sdm_conv_gradient};
    return &native;
}
