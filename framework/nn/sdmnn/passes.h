/* The passes of sdmnn through the steps of its plan (plan.h): forward, tangent, backward. maps,
   slope, tangent and back are blocks of p->floats floats; maps, tangent and back must have been
   cleared once by sdm_sdmnn_plan_clear(). A pass with slopes needs a plan that was made with
   `keep`. n_threads >= 1. */
#pragma once

#include "plan.h"

/* Packed weights and biases of the convolutions, indexed by step. */
typedef struct sdmnn_layers {
    const sdm_conv_backend *backend;
    const float *packed[SDMNN_STEPS];     /* for the forward pass */
    const float *transposed[SDMNN_STEPS]; /* for the backward pass only */
    const float *bias[SDMNN_STEPS];
} sdmnn_layers;

/* Identifies the random numbers for the drop-out of one map of a batch. */
typedef struct sdmnn_draw {
    uint64_t seed, stream, draw;
} sdmnn_draw;

/* Forward pass: computes map[nz][ny][nx] (unless NULL) from volume[cells], the result of the dense
   layers. slope (unless NULL) is set to the derivatives of the activations. draw: random numbers
   for the drop-out, which needs `slope`; NULL: no drop-out. */
void sdm_sdmnn_pass_forward(const sdmnn_plan *p, const sdmnn_layers *w, const float *volume,
                            float *maps, float *slope, const sdmnn_draw *draw, float *map,
                            int n_threads);

/* Tangent pass, after a forward pass with slopes: map[nz][ny][nx] = directional derivative of the
   map for volume[cells] = directional derivative of the volume. */
void sdm_sdmnn_pass_tangent(const sdmnn_plan *p, const sdmnn_layers *w, const float *maps,
                            const float *slope, const float *volume, float *tangent, float *map,
                            int n_threads);

/* Backward pass, after a forward pass with slopes. map[nz][ny][nx]: the derivative of the loss by
   the map. Computes volume[cells] = the derivative of the loss by the volume, and adds to
   gradient[n_weights] (unless NULL) the derivative of the loss by the weights and biases of the
   convolutions. */
void sdm_sdmnn_pass_backward(const sdmnn_plan *p, const sdmnn_layers *w, const float *maps,
                             const float *slope, const float *map, float *back, float *volume,
                             float *gradient, int n_threads);
