/* Convolution kernels for AVX2 and FMA. */
#define TABLE sdm_conv_avx2
#define ISA "avx2"
#define VW 8
#define MR 4
#define NV 3
#include "conv_kernels_simd.h"
