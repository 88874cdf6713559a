/* The multi-layer perceptron of the pod network on batches. Letters: B batch, I inputs, W width. */
#ifndef SDM_MLP_H
#define SDM_MLP_H

#include "sdm/internal/pod.h"

/* Number of weights: for each layer [W][I or W] then bias [W]. */
size_t mlp_count(const sdm_pod_arch *a);

/* Layer l within the weights: matrix and bias. */
const float *mlp_layer(const sdm_pod_arch *a, const float *weights, size_t l);
const float *mlp_bias(const sdm_pod_arch *a, const float *weights, size_t l);

/* Random start: normal with variance 2 / (inputs), biases zero; counter-based. */
void mlp_init(const sdm_pod_arch *a, uint64_t seed, float *weights);

/* Floats of activations for a batch: h and slope of every layer, and two buffers of the backward
 * pass. */
size_t mlp_workspace(const sdm_pod_arch *a, size_t batch);

/* x[B][I] -> returns h[B][W] of the last layer, inside the workspace. */
const float *mlp_forward(const sdm_pod_arch *a, const float *weights, size_t batch, const float *x,
                         float *workspace, int n_threads);

/* dh[B][W], the gradient of the loss with respect to the last layer's output ->
   gradient[mlp_count], overwritten. After mlp_forward with the same arguments. */
void mlp_backward(const sdm_pod_arch *a, const float *weights, size_t batch, const float *x,
                  float *workspace, const float *dh, float *gradient, int n_threads);

#endif
