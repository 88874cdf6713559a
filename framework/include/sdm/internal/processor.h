/* The instruction set that the kernels of the map engine and of the networks use: one choice for
 * both. */
#ifndef SDM_INTERNAL_PROCESSOR_H
#define SDM_INTERNAL_PROCESSOR_H

#ifdef __cplusplus
extern "C" {
#endif

/* Each level includes those before it. Processors other than x86-64 have the baseline alone. */
enum {
    SDM_PROCESSOR_BASELINE = 0,   /* SSE2, NEON, or what the compiler takes for the machine */
    SDM_PROCESSOR_AVX2 = 1,       /* with FMA and F16C */
    SDM_PROCESSOR_AVX512 = 2,     /* F, VL, DQ, BW */
    SDM_PROCESSOR_AVX512VNNI = 3, /* products of integers, too */
    SDM_PROCESSOR_LEVELS = 4
};

/* The level in use: the highest that this processor has, unless sdm_processor_select() chose a
 * lower one. [any thread] */
int sdm_processor_level(void);

/* For tests, before other threads start: chooses a level; -1 or a level that the processor lacks
   chooses the highest. Returns the level in use from now on. */
int sdm_processor_select(int level);

#ifdef __cplusplus
}
#endif
#endif
