/* The distance map kernel for any processor. */
#define KERNEL sdm_grid_kernel_generic
#include "map.inc"
