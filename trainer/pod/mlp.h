/* The multi-layer perceptron of the `pod` network on batches: forward and backward pass. Letters: B
   batch, I inputs, W width. Results do not depend on n_threads, the number of threads of the
   caller's team (sdm/internal/team.h).

   Ranks (sdm/internal/comm.h) share a pass with the functions of mlp_ranks.h. */
#pragma once

#include "sdm/internal/pod.h"

/* Number of weights. They are stored as, for each layer, the matrix [W][I or W], then the bias
 * [W]. */
size_t trainer_mlp_count(const sdm_pod_arch *a);

/* Matrix and bias of layer l within the weights. */
const float *trainer_mlp_layer(const sdm_pod_arch *a, const float *weights, size_t l);
const float *trainer_mlp_bias(const sdm_pod_arch *a, const float *weights, size_t l);

/* Random initial weights: normal with variance 2 / (inputs of the layer) (He et al. 2015), biases
   0; counter-based random numbers. */
void trainer_mlp_init(const sdm_pod_arch *a, uint64_t seed, float *weights);

/* Floats of workspace for a batch: activations and their derivatives for every layer, and two
   buffers [B][W] of the backward pass. */
size_t trainer_mlp_workspace(const sdm_pod_arch *a, size_t batch);

/* Inputs x[B][I]. Returns the output h[B][W] of the last layer, which lies in the workspace. */
const float *trainer_mlp_forward(const sdm_pod_arch *a, const float *weights, size_t batch,
                                 const float *x, float *workspace, int n_threads);

/* gradient[trainer_mlp_count()] = derivative of the loss with respect to the weights, from
   dh[B][W], its derivative with respect to the last layer's output. Call after
   trainer_mlp_forward() with the same arguments. */
void trainer_mlp_backward(const sdm_pod_arch *a, const float *weights, size_t batch, const float *x,
                          float *workspace, const float *dh, float *gradient, int n_threads);
