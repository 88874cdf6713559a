/* The nearest features of blocks of points for any processor. */
#define KERNEL sdm_point_kernel_generic
#include "points.inc"
