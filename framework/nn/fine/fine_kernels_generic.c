/* The network of a fine level for the baseline instruction set: SSE2 on x86-64, NEON on arm64. */
#define TABLE sdm_fine_generic
#include "fine_kernels_loops.h"
