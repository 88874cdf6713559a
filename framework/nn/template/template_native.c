/* The choice of the kernels of the template network for this processor. */
#include "sdm/internal/processor.h"
#include "template_internal.h"

const template_table *sdm_template_kernels(void)
{
#if defined(__x86_64__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX512) return &sdm_template_avx512;
    if (level >= SDM_PROCESSOR_AVX2) return &sdm_template_avx2;
#endif
    return &sdm_template_generic;
}
