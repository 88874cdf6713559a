/* The nearest features of blocks of points for AVX-512: still vectors of 256 bits, but 32
 * registers. */
#define NAME(function) function##_avx512
// clang-format off: search.inc uses definitions of points.inc
#include "points.inc"
#include "search.inc"
