/* The distance map kernel for AVX-512: still vectors of 256 bits, but 32 registers. */
#define KERNEL sdm_grid_kernel_avx512
#include "map.inc"
