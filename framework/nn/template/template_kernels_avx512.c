/* Kernels of the template network for AVX-512: vectors of eight floats as for AVX2, but twice as
 * many registers. */
#define TABLE sdm_template_avx512
#define VW 8
#include "template_kernels_simd.h"
