/* The nearest features of blocks of points for AVX-512: still vectors of 256 bits, but 32 registers. */
#define KERNEL sdm_point_kernel_avx512
#include "points.inc"
