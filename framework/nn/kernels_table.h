/* What each instruction set provides; filled by kernels_*.c from one source, kernels_simd.h. */
#ifndef SDM_KERNELS_TABLE_H
#define SDM_KERNELS_TABLE_H

#include <stddef.h>
#include <stdint.h>

typedef struct kernel_table {
    const char *name;
    size_t mr, nr; /* rows and columns of the register tile of the matrix product */
    /* c[mr][ldc] (+)= a[k][mr] * b[k][nr], packed */
    void (*micro)(size_t k, const float *a, const float *b, float *c, size_t ldc, int add);
    void (*tile_f32)(size_t batch, size_t k, const float *w, const float *x, size_t ldx, float *y, size_t ldy);
    void (*tile_f16)(size_t k, const uint16_t *w, const float *x, float *y); /* batch of one */
    /* batch of two or more; panels: k * SDM_TILE floats of scratch */
    void (*tile_f16_batch)(size_t batch, size_t k, const uint16_t *w, const float *x, size_t ldx, float *y, size_t ldy,
                           float *panels);
    void (*expand_f16)(size_t n, const uint16_t *h, float *y); /* n a multiple of SDM_TILE */
    void (*exp)(size_t n, const float *x, float *y);
} kernel_table;

extern const kernel_table sdm_kernels_generic;
#if defined(__x86_64__)
extern const kernel_table sdm_kernels_avx2, sdm_kernels_avx512;
#endif

#endif
