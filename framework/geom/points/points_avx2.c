/* The nearest features of blocks of points for AVX2 with fused multiply-add. */
#define KERNEL sdm_point_kernel_avx2
#include "points.inc"
