/* Places of points on the Hilbert curve, for any processor. */
#define KERNEL sdm_point_keys_generic
#include "point_keys.inc"
