/* The kernels, written once with the compiler's vector types and compiled once for each instruction set. Before inclusion:
   TABLE (name of the kernel_table), ISA (text), VW (floats in a register), MR (rows of the register tile). */
#include <string.h>

#include "kernels_table.h"
#include "sdm/kernels.h"

#define NV 2 /* registers in a row of the register tile */
#define NR (NV * VW)

typedef float vec __attribute__((vector_size(4 * VW)));
typedef float vec_u __attribute__((vector_size(4 * VW), aligned(4)));
typedef int32_t veci __attribute__((vector_size(4 * VW)));
typedef uint32_t vecu __attribute__((vector_size(4 * VW)));

static inline vec load(const float *p) { return *(const vec_u *)p; }
static inline void store(float *p, vec v) { *(vec_u *)p = v; }
static inline vec splat(float v) { return v - (vec){0}; }

static void micro(size_t k, const float *a, const float *b, float *c, size_t ldc, int add)
{
    vec acc[MR][NV];
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < NV; j++) acc[i][j] = add ? load(c + (size_t)i * ldc + j * VW) : (vec){0};
    for (size_t p = 0; p < k; p++, a += MR, b += NR) {
        vec row[NV];
        for (int j = 0; j < NV; j++) row[j] = load(b + j * VW);
        for (int i = 0; i < MR; i++) {
            const vec s = splat(a[i]);
            for (int j = 0; j < NV; j++) acc[i][j] += s * row[j];
        }
    }
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < NV; j++) store(c + (size_t)i * ldc + j * VW, acc[i][j]);
}

// maps `count` (1..4) rows of x at once: the weights are read once for all of them
#define TILE_ROWS(count)                                                                                               \
    static void tile_rows_##count(size_t k, const float *w, const float *x, size_t ldx, float *y, size_t ldy)          \
    {                                                                                                                  \
        enum { width = count == 1 ? 8 : 2 }; /* registers of outputs at a time: independent chains hide the latency */ \
        const size_t step = width * VW <= SDM_TILE ? width * VW : SDM_TILE;                                            \
        for (size_t o = 0; o < SDM_TILE; o += step) {                                                                  \
            vec acc[count][width] = {{{0}}};                                                                           \
            for (size_t p = 0; p < k; p++) {                                                                           \
                const float *row = w + p * SDM_TILE + o;                                                               \
                for (int i = 0; i < count; i++) {                                                                      \
                    const vec s = splat(x[(size_t)i * ldx + p]);                                                       \
                    for (int j = 0; j < (int)(step / VW); j++) acc[i][j] += s * load(row + j * VW);                    \
                }                                                                                                      \
            }                                                                                                          \
            for (int i = 0; i < count; i++)                                                                            \
                for (int j = 0; j < (int)(step / VW); j++)                                                             \
                    store(y + (size_t)i * ldy + o + (size_t)(j * VW), acc[i][j]);                                      \
        }                                                                                                              \
    }
TILE_ROWS(1)
TILE_ROWS(2)
TILE_ROWS(4)

static void tile_f32(size_t batch, size_t k, const float *w, const float *x, size_t ldx, float *y, size_t ldy)
{
    size_t i = 0;
    for (; i + 4 <= batch; i += 4) tile_rows_4(k, w, x + i * ldx, ldx, y + i * ldy, ldy);
    for (; i + 2 <= batch; i += 2) tile_rows_2(k, w, x + i * ldx, ldx, y + i * ldy, ldy);
    for (; i < batch; i++) tile_rows_1(k, w, x + i * ldx, ldx, y + i * ldy, ldy);
}

#ifndef LOAD_HALF
// exact for every half: the exponent is moved by a multiplication, which also makes subnormals right
static inline vec load_half(const uint16_t *p)
{
    vecu h;
    for (int i = 0; i < VW; i++) h[i] = p[i];
    const vecu sign = (h & 0x8000u) << 16, body = (h & 0x7fffu) << 13;
    vec v;
    memcpy(&v, &body, sizeof v);
    v *= 0x1p112f;
    vecu bits;
    memcpy(&bits, &v, sizeof v);
    // an exponent of all ones stays one: infinity and NaN
    bits |= (vecu)((h & 0x7c00u) == 0x7c00u) & 0x7f800000u;
    bits |= sign;
    memcpy(&v, &bits, sizeof v);
    return v;
}
#endif

static void tile_f16(size_t k, const uint16_t *w, const float *x, float *y)
{
    enum { registers = SDM_TILE / VW, width = registers < 8 ? registers : 8 };
    for (size_t o = 0; o < SDM_TILE; o += width * VW) {
        vec acc[width] = {{0}};
        for (size_t p = 0; p < k; p++) {
            const vec s = splat(x[p]);
            for (int j = 0; j < width; j++) acc[j] += s * load_half(w + p * SDM_TILE + o + (size_t)(j * VW));
        }
        for (int j = 0; j < width; j++) store(y + o + (size_t)(j * VW), acc[j]);
    }
}

static void expand_f16(size_t n, const uint16_t *h, float *y)
{
    for (size_t i = 0; i < n; i += VW) store(y + i, load_half(h + i));
}

// panels[T / NR][k][NR] as float from a tile of halves: a panel is read front to back and stays in the first-level cache
static void expand_panels(size_t k, const uint16_t *w, float *panels)
{
    for (size_t p = 0; p < k; p++)
        for (size_t j = 0; j < SDM_TILE / NR; j++)
            for (size_t v = 0; v < NV; v++)
                store(panels + (j * k + p) * NR + v * VW, load_half(w + p * SDM_TILE + j * NR + v * VW));
}

// `count` rows of x times one panel
#define PANEL_ROWS(count)                                                                                              \
    static void panel_rows_##count(size_t k, const float *panel, const float *x, size_t ldx, float *y, size_t ldy)     \
    {                                                                                                                  \
        vec acc[count][NV] = {{{0}}};                                                                                  \
        for (size_t p = 0; p < k; p++, panel += NR) {                                                                  \
            vec w[NV];                                                                                                 \
            for (int j = 0; j < NV; j++) w[j] = load(panel + j * VW);                                                  \
            for (int i = 0; i < count; i++) {                                                                          \
                const vec s = splat(x[(size_t)i * ldx + p]);                                                           \
                for (int j = 0; j < NV; j++) acc[i][j] += s * w[j];                                                    \
            }                                                                                                          \
        }                                                                                                              \
        for (int i = 0; i < count; i++)                                                                                \
            for (int j = 0; j < NV; j++) store(y + (size_t)i * ldy + (size_t)(j * VW), acc[i][j]);                     \
    }
PANEL_ROWS(6)
PANEL_ROWS(5)
PANEL_ROWS(4)
PANEL_ROWS(3)
PANEL_ROWS(2)
PANEL_ROWS(1)

static void tile_f16_batch(size_t batch, size_t k, const uint16_t *w, const float *x, size_t ldx, float *y, size_t ldy,
                           float *panels)
{
    expand_panels(k, w, panels);
    for (size_t j = 0; j < SDM_TILE / NR; j++, panels += k * NR, y += NR) {
        size_t i = 0;
        for (; i + 6 <= batch; i += 6) panel_rows_6(k, panels, x + i * ldx, ldx, y + i * ldy, ldy);
        switch (batch - i) {
        case 5:
            panel_rows_5(k, panels, x + i * ldx, ldx, y + i * ldy, ldy);
            break;
        case 4:
            panel_rows_4(k, panels, x + i * ldx, ldx, y + i * ldy, ldy);
            break;
        case 3:
            panel_rows_3(k, panels, x + i * ldx, ldx, y + i * ldy, ldy);
            break;
        case 2:
            panel_rows_2(k, panels, x + i * ldx, ldx, y + i * ldy, ldy);
            break;
        case 1:
            panel_rows_1(k, panels, x + i * ldx, ldx, y + i * ldy, ldy);
            break;
        default:
            break;
        }
    }
}

// exp by 2^n times a polynomial of degree 6 on [-ln 2 / 2, ln 2 / 2] (coefficients: Taylor, adjusted by the Cephes library's expf)
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
    const vec shifted = x * 1.44269504088896341f + 12582912.0f,
              n = shifted - 12582912.0f; // round to the nearest integer
    const vec r = (x - n * 0.693359375f) + n * 2.12194440e-4f;
    vec p = splat(1.9875691500e-4f);
    p = p * r + 1.3981999507e-3f;
    p = p * r + 8.3334519073e-3f;
    p = p * r + 4.1665795894e-2f;
    p = p * r + 1.6666665459e-1f;
    p = p * r + 5.0000001201e-1f;
    p = p * r * r + r + 1.0f;
    memcpy(&bits, &shifted, sizeof shifted);
    const vecu scale = ((bits & 0x3ffu) + (127u - 0u)) << 23; // low bits of `shifted` hold n in two's complement
    vec s;
    memcpy(&s, &scale, sizeof s);
    return p * s;
}

static void exp_all(size_t n, const float *x, float *y)
{
    size_t i = 0;
    for (; i + VW <= n; i += VW) store(y + i, exp_vec(load(x + i)));
    if (i == n) return;
    float rest[VW] = {0};
    memcpy(rest, x + i, (n - i) * sizeof *x);
    store(rest, exp_vec(load(rest)));
    memcpy(y + i, rest, (n - i) * sizeof *x);
}

const kernel_table TABLE = {.name = ISA,
                            .mr = MR,
                            .nr = NR,
                            .micro = micro,
                            .tile_f32 = tile_f32,
                            .tile_f16 = tile_f16,
                            .expand_f16 = expand_f16,
                            .tile_f16_batch = tile_f16_batch,
                            .exp = exp_all};
