/* The distance map kernel for AVX2 with fused multiply-add. */
#define KERNEL sdm_grid_kernel_avx2
#include "map.inc"
