/* Kernels for AVX-512 with VNNI, where one instruction multiplies integers and adds the products to
   a sum. */
#define TABLE sdm_kernels_avx512vnni
#define ISA "avx512vnni"
#define ADD_MADD(sum, a, b) ((vecu)_mm512_dpwssd_epi32((__m512i)(sum), (__m512i)(a), (__m512i)(b)))
#include "kernels_avx512.c"
