/* Choice of the instruction set for the kernels of the map engine and of the networks. */
#pragma once

#ifdef __cplusplus
extern "C" {
#endif

/* Levels of instruction sets; each level includes all lower ones. Processors other than x86-64 have
 * only the baseline. */
enum {
    SDM_PROCESSOR_BASELINE = 0,   /* SSE2, NEON, or the compiler's default */
    SDM_PROCESSOR_AVX2 = 1,       /* AVX2 with FMA and F16C */
    SDM_PROCESSOR_AVX512 = 2,     /* AVX-512 F, VL, DQ and BW */
    SDM_PROCESSOR_AVX512VNNI = 3, /* with VNNI: dot products of 16-bit (and 8-bit) integers */
    SDM_PROCESSOR_LEVELS = 4
};

/* The level in use: the highest one of this processor, unless sdm_processor_select() chose a lower
 * one. [any thread] */
int sdm_processor_level(void);

/* For tests, before other threads start: chooses a level and returns the level that is then in use.
 * -1 or a level that the processor lacks selects the highest level of the processor. */
int sdm_processor_select(int level);

#ifdef __cplusplus
}
#endif
