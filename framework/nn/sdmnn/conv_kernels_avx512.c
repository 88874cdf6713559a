/* Convolution kernels for AVX-512. */
#define TABLE sdm_conv_avx512
#define ISA "avx512"
#define VW 16
#define MR 8
#define NV 3
#include "conv_kernels_simd.h"
