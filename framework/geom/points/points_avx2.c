/* The nearest features of blocks of points for AVX2 with fused multiply-add. */
#define NAME(function) function##_avx2
// clang-format off: search.inc uses definitions of points.inc
#include "points.inc"
#include "search.inc"
