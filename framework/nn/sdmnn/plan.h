/* The architecture of sdmnn (sdm/internal/sdmnn.h) as a list of steps from the volume of the dense
   layers to the map, with the offset of every feature map in one block of memory, called the maps.
   Slopes, gradients and tangents are further blocks with the same offsets. A concatenation needs no
   step, because the feature maps that it joins are stored one after the other. */
#pragma once

#include <stdbool.h>

#include "conv.h"
#include "sdm/internal/sdmnn.h"

enum { SDMNN_LEVELS = SDM_SDMNN_MAX_DEPTH + 1, SDMNN_STEPS = 7 * SDM_SDMNN_MAX_DEPTH + 3 };

typedef enum sdmnn_op { SDMNN_CONV, SDMNN_POOL, SDMNN_UPSAMPLE } sdmnn_op;

typedef struct sdmnn_step {
    sdmnn_op op;
    size_t level;    /* level of the output */
    size_t from, to; /* offsets of input and output in the maps */
    sdm_conv conv;   /* conv.out: number of output channels, for all operators */
    size_t weights;  /* convolution: index of its first weight; the biases follow the weights */
    bool linear;     /* no activation */
    bool drop;       /* drop-out in training */
} sdmnn_step;

/* One feature map of the block `maps`. level = SDMNN_LEVELS stands for the volume, whose layout is
   sdmnn_plan.cell. */
typedef struct sdmnn_buffer {
    size_t level, channels, offset;
} sdmnn_buffer;

typedef struct sdmnn_plan {
    sdm_sdmnn_arch arch;
    size_t n_cells[3], cells;     /* cells of the volume along x, y, z, and their total number */
    sdm_fmap cell;                /* layout of the volume */
    sdm_fmap level[SDMNN_LEVELS]; /* layout of each level */
    size_t volume;                /* offset of the volume in the maps, one channel */
    size_t input, output; /* offsets of the up-sampled volume and of the map, one channel each */
    size_t floats;        /* number of floats of the maps */
    size_t n_weights;     /* sdm_sdmnn_count() */
    sdmnn_step steps[SDMNN_STEPS];
    size_t n_steps;
    sdmnn_buffer buffers[SDMNN_STEPS + 2];
    size_t n_buffers;
} sdmnn_plan;

/* *plan = the steps of an architecture that has passed sdm_sdmnn_check(). keep: every feature map
   has memory of its own, as gradients and tangents need; otherwise the way up reuses the memory of
   the way down. */
void sdm_sdmnn_plan_make(const sdm_sdmnn_arch *a, bool keep, sdmnn_plan *plan);

/* Writes the zeros before, between and after the channels of every feature map in
   maps[plan->floats]. */
void sdm_sdmnn_plan_clear(const sdmnn_plan *plan, float *maps);

/* Number of weights of the first dense layer (w1[W][P], b1[W]) and of the second (w2[cells][W],
   b2[cells]). They come before all other weights. */
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
