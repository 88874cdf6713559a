/* Instruction set of the processor. */
#include "sdm/internal/processor.h"

static int wanted_level = -1;

/* This function is cheap enough to be called by every kernel: __builtin_cpu_supports() reads flags
 * that the start-up code of the compiler's run-time library has stored. */
int sdm_processor_level(void)
{
    int best = SDM_PROCESSOR_BASELINE;
#if defined(__x86_64__) && defined(__GNUC__)
    // "f16c" is not tested because clang 14 does not accept the name; every processor with AVX2 has
    // it
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) best = SDM_PROCESSOR_AVX2;
    if (best == SDM_PROCESSOR_AVX2 && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512bw"))
        best = SDM_PROCESSOR_AVX512;
    if (best == SDM_PROCESSOR_AVX512 && __builtin_cpu_supports("avx512vnni"))
        best = SDM_PROCESSOR_AVX512VNNI;
#endif
    return wanted_level >= 0 && wanted_level < best ? wanted_level : best;
}

int sdm_processor_select(int level)
{
    wanted_level = level;
    return sdm_processor_level();
}
