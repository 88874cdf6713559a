/* The network of a fine level, for 16 cells at once; compiled for several instruction sets, with
   the same bits. Internal to the room `fine`. */
#pragma once

#include "sdm/internal/fine.h"

/* Cells that are computed together. */
enum { FINE_CELLS = 16 };

typedef struct fine_table {
    /* values[1 + n_tangents][SDM_FINE_STENCIL][16]: stencils, mm, and their derivatives; becomes
       out[1 + n_tangents][SDM_FINE_OUTPUTS][16]: changes, mm, and their derivatives. h: the
       smallest spacing, mm. All arrays are 64-byte aligned. */
    void (*cells)(const sdm_fine *f, float h, size_t n_tangents, const float *values, float *out);
} fine_table;

extern const fine_table sdm_fine_generic, sdm_fine_avx2, sdm_fine_avx512;

/* The table for this processor. */
const fine_table *sdm_fine_kernels(void);
