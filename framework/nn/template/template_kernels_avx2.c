/* Kernels of the template network for AVX2. */
#define TABLE sdm_template_avx2
#define VW 8
#include "template_kernels_simd.h"
