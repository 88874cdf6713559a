/* The nearest features of blocks of points for any processor. */
#define NAME(function) function##_generic
// clang-format off: search.inc uses definitions of points.inc
#include "points.inc"
#include "search.inc"
