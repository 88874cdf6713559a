/* The inner loops of the convolution, one table for each instruction set. conv_kernels_*.c compile
   one source, conv_kernels_simd.h. A position is an index within a channel, voxel or padding
   (fmap.h). */
#ifndef SDM_CONV_KERNELS_H
#define SDM_CONV_KERNELS_H

#include <stddef.h>

/* Terms (pairs of input channel and tap) that are summed in one pass; their weights stay in the
   first-level cache. */
#define SDM_CONV_TERMS 216
/* Positions of a channel in one unit of work, a multiple of every `nr`. */
#define SDM_CONV_CHUNK 768
/* Upper bounds of nr and of 3 * mr * width. */
#define SDM_CONV_NR_MAX 48
#define SDM_CONV_SUMS_MAX 384

typedef struct conv_table {
    const char *name;
    size_t mr;    /* output channels of a tile */
    size_t nr;    /* positions of a tile */
    size_t width; /* floats in a register */
    /* y[i][p] = sum over k of a[k][i] * x[offset[k] + p], or += with `add`: mr channels i of
       y[mr][ldy], nr positions p. */
    void (*tile)(size_t k, const float *a, const float *x, const ptrdiff_t *offset, float *y,
                 size_t ldy, int add);
    /* sums[i][j][p % width] += dy[i][p] * x[offset[j] + p] over n positions p, n a multiple of
   width: mr channels i of dy[mr][ldy], three offsets j, sums[mr][3][width]. */
    void (*dot)(size_t n, const float *dy, size_t ldy, const float *x, const ptrdiff_t *offset,
                float *sums);
} conv_table;

extern const conv_table sdm_conv_generic;
#if defined(__x86_64__)
extern const conv_table sdm_conv_avx2, sdm_conv_avx512;
#endif

#endif
