/* What decoder and transpose of a pod network share: the memory of a thread. Letters as in
 * sdm/pod.h. */
#ifndef SDM_POD_DECODE_SCRATCH_H
#define SDM_POD_DECODE_SCRATCH_H

#include "pod_internal.h"

/* Inputs of blocks: floats x[G][ld], or integers q[G][ld] with a factor for each row. */
typedef struct input {
    float *x;
    int16_t *q;
    float *scale; /* [G] */
    size_t ld;
} input;

/* Memory of a thread, for G rows. */
typedef struct slab_scratch {
    float *y[SDM_POD_MAX_LEVELS]; /* [G][padded outputs of a block] */
    input x[SDM_POD_MAX_LEVELS];  /* bytes, above the lowest level: those of blocks that get theirs
                                     together */
    input leaves; /* those of all blocks of the lowest level of a slab; scale: [groups][G] */
    float *line;  /* [G][ld_line] voxels of blocks of the lowest level side by side along x,
                     [nz][ny][nx] */
    size_t ld_line;
    float *back; /* [inputs of a slab] gradient there */
} slab_scratch;

/* Sets the pointers into memory[] (NULL: none) for G rows; returns the floats needed. */
size_t sdm_pod_slab_scratch_carve(const pod_network *m, size_t rows, float *memory,
                                  slab_scratch *s);

static inline bool sdm_pod_is_bytes(const pod_network *m) { return m->type == SDM_POD_I8; }

static inline size_t sdm_pod_first_voxel(const sdm_grid *g, const sdm_pod_block *b)
{
    return ((size_t)b->at[2] * (size_t)g->n[1] + b->at[1]) * (size_t)g->n[0] + b->at[0];
}

#endif
