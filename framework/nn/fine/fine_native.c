/* The choice of the kernels of the fine level for this processor. */
#include "fine_kernels.h"
#include "sdm/internal/processor.h"

const fine_table *sdm_fine_kernels(void)
{
#if defined(__x86_64__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX512) return &sdm_fine_avx512;
    if (level >= SDM_PROCESSOR_AVX2) return &sdm_fine_avx2;
#endif
    return &sdm_fine_generic;
}
