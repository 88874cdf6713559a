/* Choice of the instruction set, the blocked matrix product, packing of weights, half precision. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernels_table.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/team.h"

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

// A block of the matrix product is the work of one thread: MC rows and NC columns of c.
enum { MC = 264, NC = 32 };

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }

// A matrix product: the arguments of sdm_gemm().
typedef struct gemm {
    size_t m, n, k;
    sdm_view a, b;
    bool add;
    float *c;
    size_t ldc;
    size_t rows; // blocks along the rows of c
} gemm;

static void gemm_block(void *user, size_t index, int member)
{
    const gemm *g = user;
    const size_t i = index % g->rows * MC, j = index / g->rows * NC;
    (void)member;
    kernels()->product(min_size(MC, g->m - i), min_size(NC, g->n - j), g->k,
                       (sdm_view){g->a.data + i * g->a.row, g->a.row, g->a.col},
                       (sdm_view){g->b.data + j * g->b.col, g->b.row, g->b.col}, g->add,
                       g->c + i * g->ldc + j, g->ldc);
}

void sdm_gemm(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c, size_t ldc,
              int n_threads)
{
    gemm g = {m, n, k, a, b, add, c, ldc, (m + MC - 1) / MC};
    sdm_team_run(n_threads, g.rows * ((n + NC - 1) / NC), gemm_block, &g);
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

void sdm_panel_row_i8(size_t n_wide, size_t k, const int8_t *panels, size_t row, float *w)
{
    const size_t wide = sdm_panel_even(n_wide), even = sdm_panel_even(k);
    const int8_t *panel = panels + row / SDM_PANEL * SDM_PANEL * (wide + even);
    for (size_t i = 0; i < even; i += 2) {
        const size_t size = i < wide ? 2 : 1;
        for (size_t q = i; q < i + 2 && q < k; q++) {
            const int8_t *from = panel + (row % SDM_PANEL * 2 + q - i) * size;
            int16_t two = 0;
            memcpy(&two, from, size);
            w[q] = size == 2 ? (float)two : (float)*from;
        }
        panel += 2 * SDM_PANEL * size;
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
