/* The kernels, written once with the compiler's vector types and compiled once for each instruction
   set. Before inclusion, define TABLE (name of the kernel_table), ISA (name of the instruction
   set), VW (floats in a register) and MR (rows of the register tile of the matrix product);
   optionally LOAD_HALF with load_half(), STREAM(p, v) (a store that bypasses the caches), and the
   macros of kernels_vector.h and kernels_bytes.h. */
#include <string.h>

#include "kernels_bytes.h"
#include "kernels_product.h"
#include "kernels_table.h"
#include "kernels_vector.h"
#include "sdm/internal/kernels.h"

#ifndef LOAD_HALF
typedef uint16_t vech __attribute__((vector_size(2 * VW)));

// Converts halves to floats exactly. The bits of the half, shifted to their places in a float, give
// a value that is too small by the factor 2^112 because of the different exponent bias; the
// multiplication by 2^112 also handles subnormals.
static inline vec load_half(const uint16_t *p)
{
    vech packed;
    memcpy(&packed, p, sizeof packed);
    const vecu h = __builtin_convertvector(packed, vecu);
    const vecu sign = (h & 0x8000u) << 16, body = (h & 0x7fffu) << 13;
    vec v;
    memcpy(&v, &body, sizeof v);
    v *= 0x1p112f;
    vecu bits;
    memcpy(&bits, &v, sizeof v);
    // infinity and NaN: an exponent of all ones stays all ones
    bits |= (vecu)((h & 0x7c00u) == 0x7c00u) & 0x7f800000u;
    bits |= sign;
    memcpy(&v, &bits, sizeof v);
    return v;
}
#endif

// Offset of the weights of output register j (outputs j * VW .. j * VW + VW - 1), in elements.
#define PANEL_AT(j) ((size_t)((j)*VW / SDM_PANEL) * SDM_PANEL * k + (size_t)((j)*VW % SDM_PANEL))

// Defines a function that multiplies `rows` rows of x by the weights of n registers of outputs.
#define PANEL_BLOCK(type, suffix, load_weights, rows, n)                                           \
    static void block_##suffix##_##rows##x##n(size_t k, const type *w, const float *x, size_t ldx, \
                                              float *y, size_t ldy)                                \
    {                                                                                              \
        vec acc[rows][n];                                                                          \
        for (int i = 0; i < rows; i++)                                                             \
            for (int j = 0; j < n; j++) acc[i][j] = (vec){0};                                      \
        for (size_t p = 0; p < k; p++, w += SDM_PANEL) {                                           \
            vec weight[n];                                                                         \
            for (int j = 0; j < n; j++) weight[j] = load_weights(w + PANEL_AT(j));                 \
            for (int i = 0; i < rows; i++) {                                                       \
                const vec s = splat(x[(size_t)i * ldx + p]);                                       \
                for (int j = 0; j < n; j++) acc[i][j] = FMA(s, weight[j], acc[i][j]);              \
            }                                                                                      \
        }                                                                                          \
        for (int i = 0; i < rows; i++)                                                             \
            for (int j = 0; j < n; j++) store(y + (size_t)i * ldy + (size_t)(j * VW), acc[i][j]);  \
    }

// Computes the outputs from o on in blocks of n registers (n * VW outputs), as long as a whole
// block remains. For each number of rows, the largest n that is used hides the latency of the
// multiply-adds and still keeps all sums in registers.
#define PANEL_STEP(suffix, rows, n)                                                                \
    for (; o + n * VW <= outputs; o += n * VW)                                                     \
        block_##suffix##_##rows##x##n(k, w + o / SDM_PANEL * SDM_PANEL * k + o % SDM_PANEL, x,     \
                                      ldx, y + o, ldy);

#define PANEL(type, suffix, load_weights)                                                          \
    PANEL_BLOCK(type, suffix, load_weights, 1, 8)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 1, 4)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 1, 2)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 1, 1)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 2, 4)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 2, 2)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 2, 1)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 3, 4)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 3, 2)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 3, 1)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 4, 2)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 4, 1)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 5, 2)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 5, 1)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 6, 2)                                                  \
    PANEL_BLOCK(type, suffix, load_weights, 6, 1)                                                  \
    static void rows_##suffix(size_t rows, size_t outputs, size_t k, const type *w,                \
                              const float *x, size_t ldx, float *y, size_t ldy)                    \
    {                                                                                              \
        size_t o = 0;                                                                              \
        switch (rows) {                                                                            \
        case 1:                                                                                    \
            PANEL_STEP(suffix, 1, 8)                                                               \
            PANEL_STEP(suffix, 1, 4)                                                               \
            PANEL_STEP(suffix, 1, 2)                                                               \
            PANEL_STEP(suffix, 1, 1)                                                               \
            break;                                                                                 \
        case 2:                                                                                    \
            PANEL_STEP(suffix, 2, 4)                                                               \
            PANEL_STEP(suffix, 2, 2)                                                               \
            PANEL_STEP(suffix, 2, 1)                                                               \
            break;                                                                                 \
        case 3:                                                                                    \
            PANEL_STEP(suffix, 3, 4)                                                               \
            PANEL_STEP(suffix, 3, 2)                                                               \
            PANEL_STEP(suffix, 3, 1)                                                               \
            break;                                                                                 \
        case 4:                                                                                    \
            PANEL_STEP(suffix, 4, 2)                                                               \
            PANEL_STEP(suffix, 4, 1)                                                               \
            break;                                                                                 \
        case 5:                                                                                    \
            PANEL_STEP(suffix, 5, 2)                                                               \
            PANEL_STEP(suffix, 5, 1)                                                               \
            break;                                                                                 \
        default:                                                                                   \
            PANEL_STEP(suffix, 6, 2)                                                               \
            PANEL_STEP(suffix, 6, 1)                                                               \
            break;                                                                                 \
        }                                                                                          \
    }                                                                                              \
                                                                                                   \
    /* Many rows: a few panels are multiplied by all rows before the next panels, so that their    \
   weights stay in the first-level cache. */                                                       \
    static void panel_##suffix(size_t batch, size_t outputs, size_t k, const type *w,              \
                               const float *x, size_t ldx, float *y, size_t ldy)                   \
    {                                                                                              \
        if (batch <= 6) {                                                                          \
            rows_##suffix(batch, outputs, k, w, x, ldx, y, ldy);                                   \
            return;                                                                                \
        }                                                                                          \
        const size_t step = 2 * VW > SDM_PANEL ? 2 * VW : SDM_PANEL;                               \
        for (size_t o = 0; o < outputs; o += step, w += step * k)                                  \
            for (size_t i = 0; i < batch; i += 6)                                                  \
                rows_##suffix(batch - i < 6 ? batch - i : 6,                                       \
                              outputs - o < step ? outputs - o : step, k, w, x + i * ldx, ldx,     \
                              y + i * ldy + o, ldy);                                               \
    }                                                                                              \
                                                                                                   \
    static void back_##suffix(size_t outputs, size_t k, const type *w, const float *y, float *x)   \
    {                                                                                              \
        memset(x, 0, k * sizeof *x);                                                               \
        /* Four panels at a time, because the sum over the lanes of a register is expensive. */    \
        for (size_t o = 0; o < outputs; o += 4 * SDM_PANEL, w += 4 * SDM_PANEL * k) {              \
            const size_t n = outputs - o < 4 * SDM_PANEL ? outputs - o : 4 * SDM_PANEL;            \
            for (size_t p = 0; p < k; p++) {                                                       \
                vec sum = {0};                                                                     \
                for (size_t j = 0; j < n; j += VW)                                                 \
                    sum = FMA(load_weights(w + j / SDM_PANEL * SDM_PANEL * k + p * SDM_PANEL +     \
                                           j % SDM_PANEL),                                         \
                              load(y + o + j), sum);                                               \
                x[p] += SUM_LANES(sum);                                                            \
            }                                                                                      \
        }                                                                                          \
    }
PANEL(float, f32, load)
PANEL(uint16_t, f16, load_half)

// exp(x) = 2^n exp(r), n = x / ln 2 rounded, abs(r) <= ln 2 / 2. exp(r) is a polynomial of degree 7
// with the coefficients of expf() in the Cephes library (Moshier). x is clamped to -87 .. 88.
// Without FMA(), so that networks have the same activations on every instruction set.
static inline vec exp_vec(vec x)
{
    const vec lo = splat(-87.0f), hi = splat(88.0f);
    const veci below = x<lo, above = x> hi;
    vecu bits, b2;
    memcpy(&bits, &x, sizeof x);
    memcpy(&b2, &lo, sizeof lo);
    bits = (bits & ~(vecu)below) | (b2 & (vecu)below);
    memcpy(&b2, &hi, sizeof hi);
    bits = (bits & ~(vecu)above) | (b2 & (vecu)above);
    memcpy(&x, &bits, sizeof x);
    // adding 1.5 * 2^23 rounds to the nearest integer
    const vec shifted = x * 1.44269504088896341f + 12582912.0f, n = shifted - 12582912.0f;
    const vec r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
    vec p = splat(1.9875691500e-4f);
    p = p * r + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * r * r + r + 1.0f;
    memcpy(&bits, &shifted, sizeof shifted);
    // the low bits of `shifted` hold n in two's complement; scale = bits of 2^n
    const vecu scale = ((bits & 0x3ffu) + 127u) << 23;
    vec s;
    memcpy(&s, &scale, sizeof s);
    return p * s;
}

static void exp_all(size_t n, const float *x, float *y)
{
    size_t i = 0;
    for (; i + VW <= n; i += VW) store(y + i, exp_vec(load(x + i)));
    if (i == n) return;
    float tail[VW] = {0};
    memcpy(tail, x + i, (n - i) * sizeof *x);
    store(tail, exp_vec(load(tail)));
    memcpy(y + i, tail, (n - i) * sizeof *x);
}

#ifdef STREAM
// Copies with stores that bypass the caches. The ends of `to` that do not fill a register are
// streamed four floats at a time: an ordinary store would first read the cache line.
static inline void copy_streaming(size_t n, const float *y, float *to)
{
    size_t i = -(uintptr_t)to / sizeof *to % 4;
    if (n < i) i = n;
    memcpy(to, y, i * sizeof *to);
    for (; i + 4 <= n && (uintptr_t)(to + i) % (4 * VW); i += 4)
        _mm_stream_ps(to + i, _mm_loadu_ps(y + i));
    for (; i + 4 * VW <= n; i += 4 * VW) EACH(j, 4) STREAM(to + i + j * VW, load(y + i + j * VW));
    for (; i + VW <= n; i += VW) STREAM(to + i, load(y + i));
    for (; i + 4 <= n; i += 4) _mm_stream_ps(to + i, _mm_loadu_ps(y + i));
    memcpy(to + i, y + i, (n - i) * sizeof *to);
}
#endif

static void copy_floats(size_t n, const float *y, float *to, bool stream)
{
#ifdef STREAM
    if (stream) {
        copy_streaming(n, y, to);
        return;
    }
#else
    (void)stream;
#endif
    memcpy(to, y, n * sizeof *to);
}

const kernel_table TABLE = {.name = ISA,
                            .product = product,
                            .panel_f32 = panel_f32,
                            .panel_f16 = panel_f16,
                            .back_f32 = back_f32,
                            .back_f16 = back_f16,
                            .panel_i8 = panel_i8,
                            .panel_i8_blocks = panel_i8_blocks,
                            .back_i8 = back_i8,
                            .quantise = quantise,
                            .quantise_residual = quantise_residual,
                            .copy_floats = copy_floats,
                            .exp = exp_all};
