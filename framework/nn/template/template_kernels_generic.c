/* Kernels of the template network for the baseline instruction set: SSE2 on x86-64, NEON on arm64. */
#define TABLE sdm_template_generic
#include "template_kernels_simd.h"
