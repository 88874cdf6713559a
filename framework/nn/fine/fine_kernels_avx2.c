/* The network of a fine level for AVX2. */
#define TABLE sdm_fine_avx2
#include "fine_kernels_loops.h"
