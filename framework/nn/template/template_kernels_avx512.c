/* Kernels of the template network for AVX-512. */
#define TABLE sdm_template_avx512
#include "template_kernels_simd.h"
