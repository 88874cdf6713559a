/* Kernels of splines for AVX2. */
#define TABLE sdm_spline_avx2
#include "spline_kernels_loops.h"
