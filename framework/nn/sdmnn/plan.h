/* The architecture of sdmnn (sdm/sdmnn.h) as a list of steps from the volume of the dense layers to
   the map, with the place of every feature map in one block of memory. Blocks of slopes, gradients
   and tangents have the same places. */
#ifndef SDM_SDMNN_PLAN_H
#define SDM_SDMNN_PLAN_H

#include <stdbool.h>

#include "conv.h"
#include "sdm/internal/sdmnn.h"

enum { SDMNN_LEVELS = SDM_SDMNN_MAX_DEPTH + 1, SDMNN_STEPS = 7 * SDM_SDMNN_MAX_DEPTH + 3 };

typedef enum sdmnn_op { SDMNN_CONV, SDMNN_POOL, SDMNN_UPSAMPLE } sdmnn_op;

typedef struct sdmnn_step {
    sdmnn_op op;
    size_t level;    /* of the output */
    size_t from, to; /* places of input and output in the block */
    sdm_conv conv;   /* .out: channels of every operator */
    size_t weights;  /* of a convolution: first of its weights; the biases follow them */
    bool linear;     /* no activation */
    bool drop;       /* drop-out in training */
} sdmnn_step;

typedef struct sdmnn_buffer {
    size_t level, channels, place;
} sdmnn_buffer;

typedef struct sdmnn_plan {
    sdm_sdmnn_arch arch;
    size_t n_cells[3], cells; /* of the volume that the dense layers give */
    sdm_fmap cell;            /* its layout */
    sdm_fmap level[SDMNN_LEVELS];
    size_t volume; /* place of the volume, one channel of `cell` */
    size_t input,
        output;    /* places of the up-sampled volume and of the map, one channel of level 0 */
    size_t floats; /* of a block */
    size_t n_weights;
    sdmnn_step steps[SDMNN_STEPS];
    size_t n_steps;
    sdmnn_buffer buffers[SDMNN_STEPS + 2];
    size_t n_buffers;
} sdmnn_plan;

/* keep: every feature map has a place of its own, as gradients and tangents need; otherwise the way
 * up reuses memory of the way down. */
void sdm_sdmnn_plan_make(const sdm_sdmnn_arch *a, bool keep, sdmnn_plan *plan);

/* Zeros around every feature map of a block. */
void sdm_sdmnn_plan_clear(const sdmnn_plan *plan, float *block);

/* Weights of the dense layers: w1[W][P], b1[W], w2[cells][W], b2[cells], at the front of all
 * weights. */
static inline size_t sdmnn_dense1(const sdmnn_plan *p)
{
    return p->arch.width * (p->arch.n_params + 1);
}
static inline size_t sdmnn_dense2(const sdmnn_plan *p) { return p->cells * (p->arch.width + 1); }

/* Number of weights of a convolution without its biases. */
static inline size_t sdmnn_conv_weights(const sdmnn_step *s)
{
    return s->conv.in * s->conv.out * s->conv.taps;
}

#endif
