/* The passes of sdmnn through its steps (plan.h): forward, tangent, backward. Blocks are those of
   the plan, cleared by sdm_sdmnn_plan_clear() once; n_threads >= 1. */
#ifndef SDM_SDMNN_PASSES_H
#define SDM_SDMNN_PASSES_H

#include "plan.h"

/* Weights of the convolutions, at the index of their step. */
typedef struct sdmnn_layers {
    const sdm_conv_backend *backend;
    const float *packed[SDMNN_STEPS];     /* for the forward pass */
    const float *transposed[SDMNN_STEPS]; /* for the backward pass, else not used */
    const float *bias[SDMNN_STEPS];
} sdmnn_layers;

/* Drop-out of one map of a batch: random numbers of (seed, stream, draw). */
typedef struct sdmnn_draw {
    uint64_t seed, stream, draw;
} sdmnn_draw;

/* volume[cells] as the dense layers give it -> map[nz][ny][nx], unless NULL. slope: block for the
   slopes of the activations, or NULL. draw: NULL without drop-out, which needs slopes. */
void sdm_sdmnn_pass_forward(const sdmnn_plan *p, const sdmnn_layers *w, const float *volume,
                            float *block, float *slope, const sdmnn_draw *draw, float *map,
                            int n_threads);

/* After a forward pass with slopes: tangent of the volume -> tangent of the map. */
void sdm_sdmnn_pass_tangent(const sdmnn_plan *p, const sdmnn_layers *w, const float *block,
                            const float *slope, const float *volume, float *tangent, float *map,
                            int n_threads);

/* After a forward pass with slopes: derivative of the loss by the map -> by the volume, and += by
   the weights of the convolutions, in gradient[n_weights] unless NULL. */
void sdm_sdmnn_pass_backward(const sdmnn_plan *p, const sdmnn_layers *w, const float *block,
                             const float *slope, const float *map, float *back, float *volume,
                             float *gradient, int n_threads);

#endif
