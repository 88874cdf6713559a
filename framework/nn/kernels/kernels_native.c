/* Choice of the instruction set, the blocked matrix product, packing of weights, half precision. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels_table.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/threads.h"

static const kernel_table *kernels(void)
{
    switch (sdm_processor_level()) {
#if defined(__x86_64__)
    case SDM_PROCESSOR_AVX512VNNI:
        return &sdm_kernels_avx512vnni;
    case SDM_PROCESSOR_AVX512:
        return &sdm_kernels_avx512;
    case SDM_PROCESSOR_AVX2:
        return &sdm_kernels_avx2;
#endif
    default:
        return &sdm_kernels_generic;
    }
}

const char *sdm_kernels_name(void) { return kernels()->name; }

// Block sizes of the matrix product: an MC x KC block of a and a KC x NC block of b fit in the
// second-level cache. KC also fixes the order of the sums, hence the rounding of the result.
enum { MC = 96, NC = 128, KC = 256 };

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }

// Packs one full panel: packed[k][width], element (p, i) = src[i * along + p * deep]. Callers pass
// a constant width so that the loops are unrolled.
static inline void pack_panel(size_t width, size_t k, const float *src, size_t along, size_t deep,
                              float *packed)
{
    for (size_t p = 0; p < k; p++, src += deep, packed += width) {
        if (along == 1)
            memcpy(packed, src, width * sizeof *packed);
        else
            for (size_t i = 0; i < width; i++) packed[i] = src[i * along];
    }
}

// Packs all panels: packed[ceil(count / width)][k][width] from data[i * along + p * deep] for
// i < count and p < k; the last panel is padded with zeros.
static void pack_panels(size_t count, size_t k, const float *data, size_t along, size_t deep,
                        size_t width, float *packed)
{
    for (size_t i0 = 0; i0 < count; i0 += width, packed += k * width) {
        const size_t n = min_size(width, count - i0);
        const float *src = data + i0 * along;
        if (n < width) {
            memset(packed, 0, k * width * sizeof *packed);
            for (size_t p = 0; p < k; p++)
                for (size_t i = 0; i < n; i++) packed[p * width + i] = src[i * along + p * deep];
        } else if (width == 16)
            pack_panel(16, k, src, along, deep, packed);
        else if (width == 6)
            pack_panel(6, k, src, along, deep, packed);
        else
            pack_panel(width, k, src, along, deep, packed);
    }
}

// Computes one block of c with m <= MC rows and n <= NC columns; sums over all of K.
static void gemm_block(const kernel_table *t, size_t m, size_t n, size_t k, sdm_view a, sdm_view b,
                       bool add, float *c, size_t ldc)
{
    _Alignas(64) float pa[MC * KC], pb[NC * KC], edge[12 * 32];
    for (size_t k0 = 0; k0 < k || k0 == 0; k0 += KC) {
        const size_t kc = min_size(KC, k - k0);
        const int keep = add || k0 > 0; // add to c instead of overwriting it
        pack_panels(m, kc, a.data + k0 * a.col, a.row, a.col, t->mr, pa);
        pack_panels(n, kc, b.data + k0 * b.row, b.col, b.row, t->nr, pb);
        for (size_t j = 0; j < n; j += t->nr) {
            const size_t nj = min_size(t->nr, n - j);
            for (size_t i = 0; i < m; i += t->mr) {
                const size_t mi = min_size(t->mr, m - i);
                float *at = c + i * ldc + j;
                if (mi == t->mr && nj == t->nr) {
                    t->micro(kc, pa + i * kc, pb + j * kc, at, ldc, keep);
                    continue;
                }
                // a tile that reaches beyond c is computed as a full tile in `edge`
                if (keep)
                    for (size_t r = 0; r < mi; r++)
                        memcpy(edge + r * t->nr, at + r * ldc, nj * sizeof *at);
                t->micro(kc, pa + i * kc, pb + j * kc, edge, t->nr, keep);
                for (size_t r = 0; r < mi; r++)
                    memcpy(at + r * ldc, edge + r * t->nr, nj * sizeof *at);
            }
        }
        if (k == 0) break;
    }
}

void sdm_gemm(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c, size_t ldc,
              int n_threads)
{
    const kernel_table *t = kernels();
    const long rows = (long)((m + MC - 1) / MC), cols = (long)((n + NC - 1) / NC);
    if (rows * cols < 2) n_threads = 1;
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(dynamic) num_threads(n_threads) if (n_threads > 1)
    for (long tile = 0; tile < rows * cols; tile++) {
        const size_t i = (size_t)(tile % rows) * MC, j = (size_t)(tile / rows) * NC;
        const sdm_view at = {a.data + i * a.row, a.row, a.col},
                       bt = {b.data + j * b.col, b.row, b.col};
        gemm_block(t, min_size(MC, m - i), min_size(NC, n - j), k, at, bt, add, c + i * ldc + j,
                   ldc);
    }
}

void sdm_panel_pack_f32(size_t outputs, size_t k, sdm_view w, float *panels)
{
    for (size_t o = 0; o < outputs; o += SDM_PANEL)
        for (size_t i = 0; i < k; i++)
            for (size_t j = o; j < o + SDM_PANEL; j++)
                *panels++ = j < outputs ? w.data[j * w.row + i * w.col] : 0.0f;
}

void sdm_panel_pack_f16(size_t outputs, size_t k, sdm_view w, uint16_t *panels)
{
    for (size_t o = 0; o < outputs; o += SDM_PANEL)
        for (size_t i = 0; i < k; i++)
            for (size_t j = o; j < o + SDM_PANEL; j++)
                *panels++ =
                    j < outputs ? sdm_half_from_float(w.data[j * w.row + i * w.col]) : (uint16_t)0;
}

void sdm_panel_f32(size_t batch, size_t outputs, size_t k, const float *w, const float *x,
                   size_t ldx, float *y, size_t ldy)
{
    kernels()->panel_f32(batch, sdm_panel_outputs(outputs), k, w, x, ldx, y, ldy);
}

void sdm_panel_f16(size_t batch, size_t outputs, size_t k, const uint16_t *w, const float *x,
                   size_t ldx, float *y, size_t ldy)
{
    kernels()->panel_f16(batch, sdm_panel_outputs(outputs), k, w, x, ldx, y, ldy);
}

void sdm_panel_back_f32(size_t outputs, size_t k, const float *w, const float *y, float *x)
{
    kernels()->back_f32(sdm_panel_outputs(outputs), k, w, y, x);
}

void sdm_panel_back_f16(size_t outputs, size_t k, const uint16_t *w, const float *y, float *x)
{
    kernels()->back_f16(sdm_panel_outputs(outputs), k, w, y, x);
}

size_t sdm_panel_i8_count(size_t outputs, size_t n_wide, size_t k)
{
    const size_t inputs = sdm_panel_even(n_wide) + sdm_panel_even(k);
    return outputs > SIZE_MAX - SDM_PANEL || k >= SIZE_MAX / 4 || n_wide > k ||
                   (inputs && sdm_panel_outputs(outputs) > SIZE_MAX / inputs)
               ? SIZE_MAX
               : sdm_panel_outputs(outputs) * inputs;
}

int sdm_panel_i8_limit(size_t outputs, size_t k, const int16_t *w)
{
    int64_t largest = 1; // largest sum of the magnitudes of the weights of one output
    for (size_t o = 0; o < outputs; o++) {
        int64_t sum = 0;
        for (size_t i = 0; i < k; i++) sum += abs(w[o * k + i]);
        if (sum > largest) largest = sum;
    }
    const int64_t limit = INT32_MAX / largest;
    return limit > INT16_MAX ? INT16_MAX : limit > 1 ? (int)limit : 1;
}

void sdm_panel_pack_i8(size_t outputs, size_t n_wide, size_t k, const int16_t *w, int8_t *panels)
{
    const size_t wide = sdm_panel_even(n_wide);
    for (size_t o = 0; o < outputs; o += SDM_PANEL)
        for (size_t i = 0; i < k; i += 2)
            for (size_t j = o; j < o + SDM_PANEL; j++)
                for (size_t q = i; q < i + 2; q++) {
                    const int16_t v = j < outputs && q < k ? w[j * k + q] : 0;
                    // little-endian: the first byte of v holds the whole narrow weight
                    const size_t size = i < wide ? 2 : 1;
                    memcpy(panels, &v, size);
                    panels += size;
                }
}

void sdm_quantise(size_t rows, size_t n, const float *y, size_t ldy, const float *factor, int limit,
                  int16_t *x, size_t ldx, float *scale)
{
    kernels()->quantise(rows, n, y, ldy, factor, limit, x, ldx, scale);
}

void sdm_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                           float *scale, int16_t *residual, float *residual_scale)
{
    kernels()->quantise_residual(n, y, factor, limit, x, scale, residual, residual_scale);
}

void sdm_panel_i8(size_t batch, size_t outputs, size_t n_wide, size_t k, const int8_t *w,
                  const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to)
{
    kernels()->panel_i8(batch, sdm_panel_outputs(outputs), n_wide, k, w, x, ldx, scale, to);
}

void sdm_panel_i8_blocks(size_t batch, size_t n, const sdm_panel_block *blocks, const int8_t *w,
                         const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to)
{
    kernels()->panel_i8_blocks(batch, n, blocks, w, x, ldx, scale, to);
}

void sdm_panel_back_i8(size_t outputs, size_t n_wide, size_t k, const int8_t *w, const float *y,
                       float *x)
{
    kernels()->back_i8(sdm_panel_outputs(outputs), n_wide, k, w, y, x);
}

void sdm_copy(size_t n, const float *y, float *to, bool stream)
{
    kernels()->copy_floats(n, y, to, stream);
}

void sdm_copy_end(void)
{
#if defined(__x86_64__)
    __builtin_ia32_sfence();
#endif
}

void sdm_exp(size_t n, const float *x, float *y) { kernels()->exp(n, x, y); }

uint16_t sdm_half_from_float(float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    const uint16_t sign = (uint16_t)(bits >> 16 & 0x8000u);
    const float a = fabsf(v);
    if (!(a < 65520.0f)) return (uint16_t)(sign | (a != a ? 0x7e00u : 0x7c00u));
    // subnormal halves are multiples of 2^-24; lrintf() rounds to nearest even
    if (a < 0x1p-14f) return (uint16_t)(sign | (uint16_t)lrintf(a * 0x1p24f));
    memcpy(&bits, &a, sizeof bits);
    bits += 0xfffu + (bits >> 13 & 1); // round to nearest even at bit 13
    return (uint16_t)(sign | (uint16_t)((bits >> 13) - (112u << 10)));
}

float sdm_half_to_float(uint16_t h)
{
    const uint32_t exponent = h >> 10 & 31u, mantissa = h & 1023u;
    float v = exponent == 31 ? (mantissa ? NAN : INFINITY)
              : exponent     ? ldexpf((float)(1024u + mantissa), (int)exponent - 25)
                             : ldexpf((float)mantissa, -24);
    return h & 0x8000u ? -v : v;
}
