/* Places of points on the Hilbert curve, for AVX2. */
#define KERNEL sdm_point_keys_avx2
#include "point_keys.inc"
