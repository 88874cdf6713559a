/* The block kernel for AVX-512 (vectors of 256 bits, 32 registers). */
#define KERNEL sdm_grid_kernel_avx512
#include "map.inc"
