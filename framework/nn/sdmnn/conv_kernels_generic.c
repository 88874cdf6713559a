/* Convolution kernels for the baseline instruction set: SSE2 on x86-64, NEON on arm64, elsewhere
   whatever the compiler makes of vectors of four floats. */
#define TABLE sdm_conv_generic
#define VW 4
#if defined(__aarch64__)
#define ISA "neon"
#define MR 8
#define NV 2
#else
#define ISA "baseline"
#define MR 4
#define NV 2
#endif
#include "conv_kernels_simd.h"
