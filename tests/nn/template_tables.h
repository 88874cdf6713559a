/* The kernels of the `template` network for every instruction set of this processor. */
#pragma once

#include "sdm/internal/processor.h"
#include "template/template_kernels.h"

static const template_table *tables[3];
static size_t n_tables;

static void find_tables(void)
{
    tables[n_tables++] = &sdm_template_generic;
#if defined(__x86_64__)
    const int level = sdm_processor_level();
    if (level >= SDM_PROCESSOR_AVX2) tables[n_tables++] = &sdm_template_avx2;
    if (level >= SDM_PROCESSOR_AVX512) tables[n_tables++] = &sdm_template_avx512;
#endif
}
