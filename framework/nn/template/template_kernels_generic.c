/* Kernels of the template network for the baseline instruction set: SSE2 on x86-64, NEON on arm64,
   elsewhere whatever the compiler makes of vectors of four floats. */
#define TABLE sdm_template_generic
#define VW 4
#include "template_kernels_simd.h"
