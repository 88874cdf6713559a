/* The inner loops of the convolution, one table for each instruction set; filled by
 * conv_kernels_*.c from one source, conv_kernels_simd.h. */
#ifndef SDM_CONV_KERNELS_H
#define SDM_CONV_KERNELS_H

#include <stddef.h>

/* Terms of the sum over input channels and taps that are taken together; their weights stay in the
 * first-level cache. */
#define SDM_CONV_TERMS 216
/* Positions of a channel that are taken together: a multiple of every `nr`. */
#define SDM_CONV_CHUNK 768
/* Largest nr, and largest 3 * mr * width. */
#define SDM_CONV_NR_MAX 48
#define SDM_CONV_SUMS_MAX 384

typedef struct conv_table {
    const char *name;
    size_t mr;    /* output channels of a tile */
    size_t nr;    /* positions of a tile */
    size_t width; /* numbers in a register */
    /* y[mr][ldy] at nr positions (+)= sum over k of a[k][mr] * x[offset[k] + position] */
    void (*tile)(size_t k, const float *a, const float *x, const ptrdiff_t *offset, float *y,
                 size_t ldy, int add);
    /* sums[mr][3][width] += products of dy[mr][ldy] and x shifted by each of three offsets, over n
     * positions, n a multiple of width */
    void (*dot)(size_t n, const float *dy, size_t ldy, const float *x, const ptrdiff_t *offset,
                float *sums);
} conv_table;

extern const conv_table sdm_conv_generic;
#if defined(__x86_64__)
extern const conv_table sdm_conv_avx2, sdm_conv_avx512;
#endif

#endif
