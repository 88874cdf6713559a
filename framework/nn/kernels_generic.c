/* Kernels for the baseline of the machine: SSE2 on x86-64, NEON on arm64, four-wide vectors anywhere else. */
#define TABLE sdm_kernels_generic
#if defined(__x86_64__)
#define ISA "sse2"
#elif defined(__aarch64__)
#define ISA "neon"
#else
#define ISA "generic"
#endif
#define VW 4
#define MR 6
#include "kernels_simd.h"
