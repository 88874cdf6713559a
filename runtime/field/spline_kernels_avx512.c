/* Kernels of splines for AVX-512. */
#define TABLE sdm_spline_avx512
#include "spline_kernels_loops.h"
