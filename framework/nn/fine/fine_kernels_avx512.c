/* The network of a fine level for AVX-512. */
#define TABLE sdm_fine_avx512
#include "fine_kernels_loops.h"
