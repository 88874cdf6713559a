/* The passes of sdmnn through the steps of its plan (plan.h): forward, tangent, backward. maps,
   slope, tangent and back are blocks of plan.floats floats; maps, tangent and back have been
   cleared once by sdm_sdmnn_plan_clear(). The plan of a pass with slopes has been made with `keep`.
   n_threads >= 1. */
#ifndef SDM_SDMNN_PASSES_H
#define SDM_SDMNN_PASSES_H

#include "plan.h"

/* Packed weights and biases of the convolutions, indexed by step. */
typedef struct sdmnn_layers {
    const sdm_conv_backend *backend;
    const float *packed[SDMNN_STEPS];     /* for the forward pass */
    const float *transposed[SDMNN_STEPS]; /* for the backward pass only */
    const float *bias[SDMNN_STEPS];
} sdmnn_layers;

/* Identifies the random numbers of the drop-out of one map of a batch. */
typedef struct sdmnn_draw {
    uint64_t seed, stream, draw;
} sdmnn_draw;

/* Forward pass: map[nz][ny][nx] (unless NULL) from the volume[cells] of the dense layers. slope:
   set to the derivatives of the activations, unless NULL. draw: random numbers of the drop-out,
   which needs `slope`; NULL: no drop-out. */
void sdm_sdmnn_pass_forward(const sdmnn_plan *p, const sdmnn_layers *w, const float *volume,
                            float *maps, float *slope, const sdmnn_draw *draw, float *map,
                            int n_threads);

/* After a forward pass with slopes: map[nz][ny][nx] = tangent of the map for the tangent
   volume[cells] of the volume. */
void sdm_sdmnn_pass_tangent(const sdmnn_plan *p, const sdmnn_layers *w, const float *maps,
                            const float *slope, const float *volume, float *tangent, float *map,
                            int n_threads);

/* After a forward pass with slopes: from the derivative map[nz][ny][nx] of the loss by the map to
   volume[cells], its derivative by the volume; gradient[n_weights] += its derivative by the weights
   and biases of the convolutions, unless NULL. */
void sdm_sdmnn_pass_backward(const sdmnn_plan *p, const sdmnn_layers *w, const float *maps,
                             const float *slope, const float *map, float *back, float *volume,
                             float *gradient, int n_threads);

#endif
