/* Kernels for integer weights: the sdm_panel_i8 and sdm_quantise functions of
   sdm/internal/kernels.h. A lane of 32 bits holds the weights of one output for a pair of
   neighbouring inputs, as two integers of 16 bits.

   Maps and their derivatives in forward mode have the same bits on every instruction set: sums of
   integers are exact, and floats are multiplied and added in separate roundings. Only the sums of
   the backward pass use FMA() and depend on VW.

   An instruction set may define, before inclusion:
     LOAD_PAIRS(p)          VW lanes loaded from 2 VW narrow weights (bytes) at p
     MADD(a, b)             in each lane the sum of the two products of 16-bit integers
     ADD_MADD(sum, a, b)    sum + MADD(a, b) in one instruction
     ROUND_TO_SHORTS(v)     floats rounded to nearest integers of 16 bits
     MIN_VEC, MAX_VEC       minimum and maximum of two vectors of floats
     MAX_VECI               maximum of two vectors of signed integers
     PREFETCH_BYTES         weights are prefetched this many bytes before their use; 0: never */

#pragma once

#include <string.h>

#include "kernels_table.h"
#include "kernels_vector.h"
#include "sdm/internal/kernels.h"

// the first and the second 16-bit integer of each lane, sign-extended
static inline veci first_of(veci v) { return (veci)((vecu)v << 16) >> 16; }
static inline veci second_of(veci v) { return v >> 16; }

#ifndef MADD
#define MADD(a, b) (first_of(a) * first_of(b) + second_of(a) * second_of(b))
#endif

#ifndef ADD_MADD
#define ADD_MADD(sum, a, b) ((sum) + (vecu)MADD(a, b))
#endif

#ifndef LOAD_PAIRS
static inline veci load_pairs(const int8_t *p)
{
    int8_t bytes __attribute__((vector_size(2 * VW)));
    typedef int16_t shorts __attribute__((vector_size(4 * VW)));
    memcpy(&bytes, p, sizeof bytes);
    return (veci) __builtin_convertvector(bytes, shorts);
}
#define LOAD_PAIRS(p) load_pairs(p)
#endif

// VW lanes of wide weights, two 16-bit integers each
static inline veci load_wide(const int8_t *p)
{
    veci v;
    memcpy(&v, p, sizeof v);
    return v;
}

// the pair of inputs at p in all lanes
static inline veci splat_pair(const int16_t *p)
{
    int32_t pair;
    memcpy(&pair, p, sizeof pair);
    return pair - (veci){0};
}

// stores VW outputs as rows of SDM_PANEL_ROW floats that are `line` floats apart
// (sdm_panel_out.line)
static inline void store_rows(float *y, size_t line, vec v)
{
    typedef float row __attribute__((vector_size(16)));
    row rows[VW / 4];
    memcpy(rows, &v, sizeof v);
    for (int i = 0; i < VW / 4; i++) memcpy(y + (size_t)i * line, &rows[i], sizeof *rows);
}

// Keeps the pointer p in a register, so that the compiler does not recompute base + offset for each
// use.
#define KEEP_IN_REGISTER(p) __asm__("" : "+r"(p));

#ifndef ROUND_TO_SHORTS
typedef uint16_t vec_short __attribute__((vector_size(2 * VW)));

// Rounds to nearest integers of 16 bits: after adding 1.5 * 2^23 the integer is in the low bits of
// the float.
static inline vec_short round_to_shorts(vec v)
{
    return __builtin_convertvector((vecu)(v + 12582912.0f), vec_short);
}
#define ROUND_TO_SHORTS(v) round_to_shorts(v)
#endif

#ifndef MIN_VEC
#define MIN_VEC(a, b) ((vec)(((veci)(a) & ((a) < (b))) | ((veci)(b) & ~((a) < (b)))))
#define MAX_VEC(a, b) ((vec)(((veci)(a) & ((a) > (b))) | ((veci)(b) & ~((a) > (b)))))
#endif

static inline void store_shorts(int16_t *x, vec v)
{
    const __typeof__(ROUND_TO_SHORTS(v)) s = ROUND_TO_SHORTS(v);
    memcpy(x, &s, sizeof s);
}

// v clipped to -limit .. limit; NaN becomes -limit or limit
static inline vec clip(vec v, vec limit) { return MAX_VEC(MIN_VEC(v, limit), -limit); }

// bytes that the weights of one pair of inputs have in a panel, for wide and for narrow weights
enum { WIDE = 4 * SDM_PANEL, NARROW = 2 * SDM_PANEL };

// Offset in bytes of the weights of output register j for one pair of inputs; pair: WIDE or NARROW.
#define BYTES_AT(j, pair)                                                                          \
    ((size_t)((j)*VW / SDM_PANEL) * panel + (size_t)((j)*VW % SDM_PANEL) * (pair / SDM_PANEL))

// Bytes of the weights of one pair of inputs for n registers of outputs.
#define BYTES_OF(n, pair) ((n)*VW / SDM_PANEL * (pair))

#ifndef PREFETCH_BYTES
#define PREFETCH_BYTES 0
#endif

// BYTES_SET starts a sum with the products of a pair of inputs, BYTES_ADD adds them to it. ADD_MADD
// has a longer latency than an addition, so it is used only with many independent sums.
#define BYTES_SET(many, sum, a, b) sum = (vecu)MADD(a, b)
#define BYTES_ADD(many, sum, a, b) sum = (many) ? ADD_MADD(sum, a, b) : (sum) + (vecu)MADD(a, b)

// acc[rows][n] = (into: BYTES_SET) or += (into: BYTES_ADD) the products of the next pair of inputs,
// whose weights have `pair` bytes in each panel. The inputs of all rows stay in registers if
// rows < n, else the weights of all n registers do.
#define BYTES_PAIR(rows, n, into, pair, load_pair)                                                 \
    do {                                                                                           \
        if (rows < n) {                                                                            \
            veci input[rows];                                                                      \
            EACH(i, rows) input[i] = splat_pair(x + (size_t)i * ldx);                              \
            EACH(j, n)                                                                             \
            {                                                                                      \
                const veci weight = load_pair(w + BYTES_AT(j, pair));                              \
                EACH(i, rows) into((rows) * (n) >= 4, acc[i][j], input[i], weight);                \
            }                                                                                      \
        } else {                                                                                   \
            veci weight[n];                                                                        \
            EACH(j, n) weight[j] = load_pair(w + BYTES_AT(j, pair));                               \
            EACH(i, rows)                                                                          \
            {                                                                                      \
                const veci s = splat_pair(x + (size_t)i * ldx);                                    \
                EACH(j, n) into((rows) * (n) >= 4, acc[i][j], s, weight[j]);                       \
            }                                                                                      \
        }                                                                                          \
        if (PREFETCH_BYTES && rows > 1)                                                            \
            EACH(l, BYTES_OF(n, pair) / 64) __builtin_prefetch(prefetch + 64 * l);                 \
        prefetch += BYTES_OF(n, pair);                                                             \
        w += pair, x += 2;                                                                         \
    } while (0)

static const float no_mean[8 * VW] = {0}; // zeros, added to rows without a mean

// Stores acc[rows][n] * scale as floats in to->y (sdm_panel_out), from output o on.
#define BYTES_NUMBERS(rows, n)                                                                     \
    {                                                                                              \
        const size_t line = to->line, n_mean = to->n_mean;                                         \
        const float *mean = n_mean ? to->mean + o : no_mean;                                       \
        float *y = to->y + o / 4 * line;                                                           \
        EACH(i, rows)                                                                              \
        {                                                                                          \
            const vec s = splat(scale[i]);                                                         \
            if (i == rows - 1 && i > 0 && to->residual) break;                                     \
            if ((size_t)i >= n_mean) mean = no_mean;                                               \
            EACH(j, n)                                                                             \
            {                                                                                      \
                vec v = s * __builtin_convertvector((veci)acc[i][j], vec) + load(mean + j * VW);   \
                if (i == 0 && rows > 1 && to->residual)                                            \
                    v += splat(scale[rows - 1]) *                                                  \
                         __builtin_convertvector((veci)acc[rows - 1][j], vec);                     \
                store_rows(y + (size_t)(j * VW / 4) * line, line, v);                              \
            }                                                                                      \
            y += ld;                                                                               \
            KEEP_IN_REGISTER(y)                                                                    \
        }                                                                                          \
    }
// Stores acc[rows][n] * scale * factor as integers in to->integers, from output o on.
#define BYTES_INTEGERS(rows, n)                                                                    \
    {                                                                                              \
        const vec limit = splat((float)to->limit);                                                 \
        const float *factor = to->factor + o;                                                      \
        int16_t *q = to->integers + o;                                                             \
        EACH(i, rows)                                                                              \
        {                                                                                          \
            const vec s = splat(scale[i]);                                                         \
            EACH(j, n)                                                                             \
            {                                                                                      \
                const vec v = s * __builtin_convertvector((veci)acc[i][j], vec);                   \
                store_shorts(q + j * VW, clip(v * load(factor + j * VW), limit));                  \
            }                                                                                      \
            q += ld;                                                                               \
            KEEP_IN_REGISTER(q)                                                                    \
        }                                                                                          \
    }

// Defines a function that computes the products of `rows` rows for outputs from o on, n registers
// at a time. wide, narrow: numbers of pairs. It returns the first output that it has not computed.
#define BYTES_BLOCK(rows, n)                                                                       \
    static size_t bytes_##rows##x##n(size_t o, size_t outputs, size_t wide, size_t narrow,         \
                                     const int8_t *panels, const int16_t *inputs, size_t ldx,      \
                                     const float *scale, const sdm_panel_out *to)                  \
    {                                                                                              \
        const size_t panel = wide * WIDE + narrow * NARROW, ld = to->ld;                           \
        for (; o + n * VW <= outputs; o += n * VW) {                                               \
            const int8_t *w = panels + o / SDM_PANEL * panel + o % SDM_PANEL * (WIDE / SDM_PANEL); \
            const int8_t *prefetch = panels + o / SDM_PANEL * panel + PREFETCH_BYTES;              \
            const int16_t *x = inputs;                                                             \
            vecu acc[rows][n];                                                                     \
            if (wide)                                                                              \
                BYTES_PAIR(rows, n, BYTES_SET, WIDE, load_wide);                                   \
            else                                                                                   \
                EACH(i, rows) EACH(j, n) acc[i][j] = (vecu){0};                                    \
            for (size_t p = 1; p < wide; p++) BYTES_PAIR(rows, n, BYTES_ADD, WIDE, load_wide);     \
            w -= o % SDM_PANEL * ((WIDE - NARROW) / SDM_PANEL);                                    \
            UNROLL(2)                                                                              \
            for (size_t p = 0; p < narrow; p++)                                                    \
                BYTES_PAIR(rows, n, BYTES_ADD, NARROW, LOAD_PAIRS);                                \
            if (to->y)                                                                             \
                BYTES_NUMBERS(rows, n)                                                             \
            else                                                                                   \
                BYTES_INTEGERS(rows, n)                                                            \
        }                                                                                          \
        return o;                                                                                  \
    }

#define BYTES_STEP(rows, n) o = bytes_##rows##x##n(o, outputs, wide, narrow, w, x, ldx, scale, to);

// Eight registers at a time are not used with 16 lanes: they would be eight panels, which are more
// concurrent streams of memory than the hardware prefetcher follows.
#if VW < 16
BYTES_BLOCK(1, 8)
#define BYTES_EIGHT(rows) BYTES_STEP(rows, 8)
#else
#define BYTES_EIGHT(rows)
#endif
BYTES_BLOCK(1, 4)
BYTES_BLOCK(1, 2)
BYTES_BLOCK(1, 1)
BYTES_BLOCK(2, 4)
BYTES_BLOCK(2, 2)
BYTES_BLOCK(2, 1)
// WebAssembly computes one map at a time, which has two rows: code for more would enlarge pages.
#ifdef __wasm__
#define BYTES_ROWS 2
#else
#define BYTES_ROWS 6
BYTES_BLOCK(3, 4)
BYTES_BLOCK(3, 2)
BYTES_BLOCK(3, 1)
BYTES_BLOCK(4, 2)
BYTES_BLOCK(4, 1)
BYTES_BLOCK(5, 2)
BYTES_BLOCK(5, 1)
BYTES_BLOCK(6, 2)
BYTES_BLOCK(6, 1)
#endif

// computes all outputs of up to BYTES_ROWS rows
static void bytes_rows(size_t rows, size_t outputs, size_t wide, size_t narrow, const int8_t *w,
                       const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to)
{
    size_t o = 0;
    switch (rows) {
    case 1:
        BYTES_EIGHT(1)
        BYTES_STEP(1, 4)
        BYTES_STEP(1, 2)
        BYTES_STEP(1, 1)
        break;
    case 2:
        BYTES_STEP(2, 4)
        BYTES_STEP(2, 2)
        BYTES_STEP(2, 1)
        break;
#if BYTES_ROWS > 2
    case 3:
        BYTES_STEP(3, 4)
        BYTES_STEP(3, 2)
        BYTES_STEP(3, 1)
        break;
    case 4:
        BYTES_STEP(4, 2)
        BYTES_STEP(4, 1)
        break;
    case 5:
        BYTES_STEP(5, 2)
        BYTES_STEP(5, 1)
        break;
    default:
        BYTES_STEP(6, 2)
        BYTES_STEP(6, 1)
        break;
#endif
    }
}

// the part of the destination *to that begins at row i and output o
static inline sdm_panel_out out_from(const sdm_panel_out *to, size_t i, size_t o)
{
    sdm_panel_out at = *to;
    if (at.y) at.y += i * at.ld + o / 4 * at.line;
    if (at.integers) at.integers += i * at.ld + o, at.factor += o;
    if (at.mean) at.mean += o, at.n_mean = at.n_mean > i ? at.n_mean - i : 0;
    return at;
}

// computes all outputs of `batch` rows, BYTES_ROWS at a time
static void bytes_batch(size_t batch, size_t outputs, size_t wide, size_t narrow, const int8_t *w,
                        const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to)
{
    for (size_t i = 0; i < batch; i += BYTES_ROWS) {
        const sdm_panel_out at = out_from(to, i, 0);
        bytes_rows(batch - i < BYTES_ROWS ? batch - i : BYTES_ROWS, outputs, wide, narrow, w,
                   x + i * ldx, ldx, scale + i, &at);
    }
}

// As in panel_f32(), a few panels are multiplied with all rows before the next panels.
static void panel_i8(size_t batch, size_t outputs, size_t n_wide, size_t k, const int8_t *w,
                     const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to)
{
    const size_t wide = (n_wide + 1) / 2, narrow = (k + 1) / 2 - wide,
                 panel = wide * WIDE + narrow * NARROW;
    // rows that are computed together read each panel once, in any case
    const size_t two = 2 * VW > SDM_PANEL ? 2 * VW : SDM_PANEL,
                 step = batch <= BYTES_ROWS ? outputs : two;
    for (size_t o = 0; o < outputs; o += step, w += step / SDM_PANEL * panel) {
        const sdm_panel_out at = out_from(to, 0, o);
        bytes_batch(batch, outputs - o < step ? outputs - o : step, wide, narrow, w, x, ldx, scale,
                    &at);
    }
}

static void panel_i8_blocks(size_t batch, size_t n, const sdm_panel_block *b, const int8_t *w,
                            const int16_t *x, size_t ldx, const float *scale,
                            const sdm_panel_out *to)
{
    sdm_panel_out at = *to;
    for (const sdm_panel_block *end = b + n; b < end; b++) {
        const size_t wide = (b->n_wide + 1) / 2, narrow = (b->k + 1) / 2 - wide;
        at.y = to->y + b->y;
        if (at.mean) at.mean = to->mean + b->mean;
        bytes_batch(batch, (b->outputs + SDM_PANEL - 1) / SDM_PANEL * SDM_PANEL, wide, narrow,
                    w + b->weights, x + b->x, ldx, scale + b->scale, &at);
    }
}

// Defines a function that computes x[2 * pairs] += w^T * y for n outputs; pair: WIDE or NARROW.
#define BACK_PAIRS(name, pair, load_pair)                                                          \
    static void name(size_t n, size_t pairs, size_t panel, const int8_t *w, const float *y,        \
                     float *x)                                                                     \
    {                                                                                              \
        for (size_t p = 0; p < pairs; p++, w += pair) {                                            \
            vec a = {0}, b = {0};                                                                  \
            for (size_t j = 0; j < n; j += VW) {                                                   \
                const veci weight =                                                                \
                    load_pair(w + j / SDM_PANEL * panel + j % SDM_PANEL * (pair / SDM_PANEL));     \
                const vec at = load(y + j);                                                        \
                a = FMA(__builtin_convertvector(first_of(weight), vec), at, a);                    \
                b = FMA(__builtin_convertvector(second_of(weight), vec), at, b);                   \
            }                                                                                      \
            x[2 * p] += SUM_LANES(a);                                                              \
            x[2 * p + 1] += SUM_LANES(b);                                                          \
        }                                                                                          \
    }
BACK_PAIRS(back_wide, WIDE, load_wide)
BACK_PAIRS(back_narrow, NARROW, LOAD_PAIRS)

static void back_i8(size_t outputs, size_t n_wide, size_t k, const int8_t *w, const float *y,
                    float *x)
{
    const size_t wide = (n_wide + 1) / 2, narrow = (k + 1) / 2 - wide,
                 panel = wide * WIDE + narrow * NARROW;
    memset(x, 0, 2 * (wide + narrow) * sizeof *x);
    for (size_t o = 0; o < outputs; o += 4 * SDM_PANEL, w += 4 * panel) {
        const size_t n = outputs - o < 4 * SDM_PANEL ? outputs - o : 4 * SDM_PANEL;
        back_wide(n, wide, panel, w, y + o, x);
        back_narrow(n, narrow, panel, w + wide * WIDE, y + o, x + 2 * wide);
    }
}

// y * factor (NULL: 1) at i .. i + VW - 1
static inline vec product_at(size_t i, const float *y, const float *factor)
{
    return factor ? load(y + i) * load(factor + i) : load(y + i);
}

#ifndef MAX_VECI
#define MAX_VECI(a, b) (((a) & ((a) > (b))) | ((b) & ((a) <= (b))))
#endif

// Elementwise maximum of `largest` and abs(v), both as the bits of floats. As integers these bits
// have the same order as the magnitudes, with infinity and NaN above all numbers.
static inline veci larger_magnitude(veci largest, vec v)
{
    const veci bits = (veci)v & 0x7fffffff;
    return MAX_VECI(bits, largest);
}

// The functions from here to round_residual() need n >= VW. They process a row in registers of VW
// elements; the last register ends at element n - 1 and may overlap the one before, so that some
// elements are computed twice.

// largest magnitude of a row; infinity or NaN if an element is infinite or NaN
static inline float largest_of(size_t n, const float *y, const float *factor)
{
    const size_t last = n - VW;
    veci lanes = larger_magnitude((veci){0}, product_at(last, y, factor));
    UNROLL(4)
    for (size_t i = 0; i < last; i += VW) lanes = larger_magnitude(lanes, product_at(i, y, factor));
    int32_t bits = 0;
    for (int j = 0; j < VW; j++) bits = lanes[j] > bits ? lanes[j] : bits;
    float largest;
    memcpy(&largest, &bits, sizeof largest);
    return largest;
}

static inline void round_register(const float *y, const float *factor, float to_integer, size_t i,
                                  int16_t *x)
{
    store_shorts(x + i, product_at(i, y, factor) * to_integer);
}

// x[n] = the row rounded with the largest magnitude mapped to `limit`; returns the scale.
static inline float round_row(size_t n, const float *y, const float *factor, float largest,
                              int limit, int16_t *x)
{
    const float to_integer = (float)limit / largest;
    // `largest` is not finite (the scale is then NaN), or limit / largest overflows (scale 0)
    if (!(to_integer > 0 && to_integer <= 3e38f)) {
        memset(x, 0, n * sizeof *x);
        return largest - largest;
    }
    const size_t last = n - VW;
    UNROLL(4) for (size_t i = 0; i < last; i += VW) round_register(y, factor, to_integer, i, x);
    round_register(y, factor, to_integer, last, x);
    return largest / (float)limit;
}

// Quantises rows. The maxima of all rows are found first, so that rounding a row need not wait for
// its maximum.
static inline void quantise_rows(size_t rows, size_t n, const float *y, size_t ldy,
                                 const float *factor, int limit, int16_t *x, size_t ldx,
                                 float *scale)
{
    for (size_t r = 0; r < rows; r++) scale[r] = largest_of(n, y + r * ldy, factor);
    for (size_t r = 0; r < rows; r++)
        scale[r] = round_row(n, y + r * ldy, factor, scale[r], limit, x + r * ldx);
}

static inline vec load_shorts(const int16_t *x)
{
    int16_t shorts __attribute__((vector_size(2 * VW)));
    memcpy(&shorts, x, sizeof shorts);
    return __builtin_convertvector(__builtin_convertvector(shorts, veci), vec);
}

static inline void residual_register(const float *y, const float *factor, float to_integer,
                                     int limit, size_t i, const int16_t *x, int16_t *residual)
{
    store_shorts(residual + i,
                 (product_at(i, y, factor) * to_integer - load_shorts(x + i)) * (float)limit);
}

// residual[n] = the rounding error of round_row(), in units of (unit of x[]) / limit. The error is
// at most half a unit of x[], hence abs(residual) <= limit / 2. Returns the scale of the residual.
static inline float round_residual(size_t n, const float *y, const float *factor, float largest,
                                   int limit, const int16_t *x, int16_t *residual)
{
    const float to_integer = (float)limit / largest;
    if (!(to_integer > 0 && to_integer <= 3e38f)) {
        memset(residual, 0, n * sizeof *residual);
        return largest - largest;
    }
    const size_t last = n - VW;
    UNROLL(4)
    for (size_t i = 0; i < last; i += VW)
        residual_register(y, factor, to_integer, limit, i, x, residual);
    residual_register(y, factor, to_integer, limit, last, x, residual);
    return largest / (float)limit / (float)limit;
}

static void quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                              float *scale, int16_t *residual, float *residual_scale)
{
    if (n < VW) {
        float padded[VW] = {0};
        int16_t integers[2][VW];
        for (size_t i = 0; i < n; i++) padded[i] = factor ? y[i] * factor[i] : y[i];
        quantise_residual(VW, padded, NULL, limit, integers[0], scale, integers[1], residual_scale);
        memcpy(x, integers[0], n * sizeof *x);
        memcpy(residual, integers[1], n * sizeof *residual);
        return;
    }
    const float largest = largest_of(n, y, factor);
    *scale = round_row(n, y, factor, largest, limit, x);
    *residual_scale = round_residual(n, y, factor, largest, limit, x, residual);
}

// quantises a row with n < VW, padded with zeros
static void quantise_short(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                           float *scale)
{
    float padded[VW] = {0};
    int16_t integers[VW];
    for (size_t i = 0; i < n; i++) padded[i] = factor ? y[i] * factor[i] : y[i];
    quantise_rows(1, VW, padded, 0, NULL, limit, integers, 0, scale);
    memcpy(x, integers, n * sizeof *x);
}

static void quantise(size_t rows, size_t n, const float *y, size_t ldy, const float *factor,
                     int limit, int16_t *x, size_t ldx, float *scale)
{
    if (n < VW)
        for (size_t r = 0; r < rows; r++)
            quantise_short(n, y + r * ldy, factor, limit, x + r * ldx, scale + r);
    else if (factor)
        quantise_rows(rows, n, y, ldy, factor, limit, x, ldx, scale);
    else
        quantise_rows(rows, n, y, ldy, NULL, limit, x, ldx, scale);
}
