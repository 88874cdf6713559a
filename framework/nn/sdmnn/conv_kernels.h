/* The inner loops of the convolution, one table for each instruction set. Each of conv_kernels_*.c
   compiles the same source, conv_kernels_simd.h. A position is the index of a voxel or padding
   element within a channel (fmap.h). */
#pragma once

#include <stddef.h>

/* Number of terms (pairs of input channel and tap) that are summed in one pass; their weights stay
   in the first-level cache. */
#define SDM_CONV_TERMS 216
/* Number of positions of a channel in one unit of work, a multiple of every `nr`. */
#define SDM_CONV_CHUNK 768
/* Upper bounds of nr and of 3 * mr * width. */
#define SDM_CONV_NR_MAX 48
#define SDM_CONV_SUMS_MAX 384

typedef struct conv_table {
    const char *name;
    size_t mr;    /* number of output channels of a tile */
    size_t nr;    /* number of positions of a tile */
    size_t width; /* number of floats in a register */
    /* y[i][p] = sum over k of a[k][i] * x[offset[k] + p], or += with `add`: mr channels i of
       y[mr][ldy], nr positions p. */
    void (*tile)(size_t k, const float *a, const float *x, const ptrdiff_t *offset, float *y,
                 size_t ldy, int add);
    /* sums[i][j][p % width] += dy[i][p] * x[offset[j] + p] for mr channels i of dy[mr][ldy], three
       offsets j and n positions p; sums[mr][3][width], n is a multiple of width. */
    void (*dot)(size_t n, const float *dy, size_t ldy, const float *x, const ptrdiff_t *offset,
                float *sums);
} conv_table;

extern const conv_table sdm_conv_generic;
#if defined(__x86_64__)
extern const conv_table sdm_conv_avx2, sdm_conv_avx512;
#endif
