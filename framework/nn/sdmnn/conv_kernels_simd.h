/* The inner loops of the convolution, written once with the compiler's vector types and compiled
   once for each instruction set. Before inclusion, define TABLE (name of the conv_table), ISA (name
   of the instruction set), VW (floats in a register), MR (output channels of a tile) and NV
   (registers of positions of a tile). Contracts: conv_kernels.h. */
#include "conv_kernels.h"
#include "kernels/kernels_vector.h"

_Static_assert(SDM_CONV_CHUNK % (NV * VW) == 0 && NV * VW <= SDM_CONV_NR_MAX,
               "a unit of work consists of whole tiles");
_Static_assert(3 * MR * VW <= SDM_CONV_SUMS_MAX, "the partial sums of a tile fit in their array");

static void tile(size_t k, const float *a, const float *x, const ptrdiff_t *offset, float *y,
                 size_t ldy, int add)
{
    vec acc[MR][NV];
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < NV; j++)
            acc[i][j] = add ? load(y + (size_t)i * ldy + j * VW) : (vec){0};
    for (size_t p = 0; p < k; p++, a += MR) {
        const float *at = x + offset[p];
        vec in[NV];
        for (int j = 0; j < NV; j++) in[j] = load(at + j * VW);
        for (int i = 0; i < MR; i++) {
            const vec w = splat(a[i]);
            for (int j = 0; j < NV; j++) acc[i][j] += w * in[j];
        }
    }
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < NV; j++) store(y + (size_t)i * ldy + j * VW, acc[i][j]);
}

static void dot(size_t n, const float *dy, size_t ldy, const float *x, const ptrdiff_t *offset,
                float *sums)
{
    const float *const tap[3] = {x + offset[0], x + offset[1], x + offset[2]};
    vec acc[MR][3];
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < 3; j++) acc[i][j] = load(sums + (i * 3 + j) * VW);
    for (size_t p = 0; p < n; p += VW) {
        vec in[3];
        for (int j = 0; j < 3; j++) in[j] = load(tap[j] + p);
        for (int i = 0; i < MR; i++) {
            const vec d = load(dy + (size_t)i * ldy + p);
            for (int j = 0; j < 3; j++) acc[i][j] += d * in[j];
        }
    }
    for (int i = 0; i < MR; i++)
        for (int j = 0; j < 3; j++) store(sums + (i * 3 + j) * VW, acc[i][j]);
}

const conv_table TABLE = {
    .name = ISA, .mr = MR, .nr = NV * VW, .width = VW, .tile = tile, .dot = dot};
