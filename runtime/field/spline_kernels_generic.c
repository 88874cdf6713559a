/* Kernels of splines for the baseline instruction set: SSE2 on x86-64, NEON on arm64. */
#define TABLE sdm_spline_generic
#include "spline_kernels_loops.h"
