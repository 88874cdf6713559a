/* The choice of the spline kernels for this processor. */
#include "sdm/internal/processor.h"
#include "spline_kernels.h"

const spline_table *sdm_spline_kernels(void)
{
#if defined(__x86_64__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX512) return &sdm_spline_avx512;
    if (level >= SDM_PROCESSOR_AVX2) return &sdm_spline_avx2;
#endif
    return &sdm_spline_generic;
}
