/* Scratch memory of a thread for one slab, shared by the decoder and its transpose. Words and
   letters as in pod_internal.h. */
#pragma once

#include "pod_internal.h"

/* Inputs of blocks: floats x[R][ld] (q is NULL), or for integer weights q[R][ld] with a scale for
   each row (x is NULL). */
typedef struct input {
    float *x;
    int16_t *q;
    float *scale; /* [R] value of one unit of q in each row */
    size_t ld;    /* elements from one row to the next */
} input;

/* Scratch memory of one slab, for R <= SDM_POD_ROWS rows; a row is one map or one derivative. */
typedef struct slab_scratch {
    float *y[SDM_POD_MAX_LEVELS]; /* y[level][R][padded outputs]: outputs of one block */
    input x[SDM_POD_MAX_LEVELS];  /* integer weights: x[level] = inputs of one group, level > 0 */
    input leaves; /* inputs of all leaves of the slab; scale[groups][SDM_POD_ROWS] */
    float *line;  /* [R][ld_line] voxels of a line, [z][y][nx] */
    size_t ld_line;
    float *back; /* for the transpose: gradient by the level-0 coefficients of the slab */
} slab_scratch;

/* Sets the pointers of *s into memory[] (NULL: none) for R rows; returns the floats needed. */
size_t sdm_pod_slab_scratch_carve(const pod_network *m, size_t rows, float *memory,
                                  slab_scratch *s);

static inline bool sdm_pod_is_integer(const pod_network *m) { return m->type == SDM_POD_I8; }

/* Index of the first voxel of a block in a map [nz][ny][nx]. */
static inline size_t sdm_pod_first_voxel(const sdm_grid *g, const sdm_pod_block *b)
{
    return ((size_t)b->at[2] * (size_t)g->n[1] + b->at[1]) * (size_t)g->n[0] + b->at[0];
}
