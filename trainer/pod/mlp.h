/* The multi-layer perceptron of the `pod` network on batches: forward and backward pass. Letters: B
   batch, I inputs, W width. Results do not depend on n_threads, the number of threads of the
   caller's team (sdm/internal/team.h). */
#pragma once

#include "sdm/internal/comm.h"
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

/* Ranks share the passes of a batch with the functions below. In the forward and backward pass each
   has rows of the batch, in the gradient by the weights each has units of every layer: so each sum
   is that of one rank, in the order in which a single process computes it. */

/* As trainer_mlp_forward(), for some rows. Returns h[B][W]. */
const float *trainer_mlp_forward_rows(const sdm_pod_arch *a, const float *weights, size_t batch,
                                      sdm_comm_part rows, const float *x, float *workspace,
                                      int n_threads);

/* The part of trainer_mlp_backward() down to the inputs, for some rows. */
void trainer_mlp_backward_rows(const sdm_pod_arch *a, const float *weights, size_t batch,
                               sdm_comm_part rows, float *workspace, const float *dh,
                               int n_threads);

/* Gives all ranks all rows, after the two functions above. */
sdm_status trainer_mlp_gather_rows(const sdm_pod_arch *a, sdm_comm *comm, size_t batch,
                                   float *workspace, sdm_error *err);

/* The rest of trainer_mlp_backward(): the gradient by the weights of some units of each layer. */
void trainer_mlp_gradient_units(const sdm_pod_arch *a, size_t batch, sdm_comm_part units,
                                const float *x, float *workspace, float *gradient, int n_threads);

/* Gives all ranks the gradient by the weights of all units. */
sdm_status trainer_mlp_gather_units(const sdm_pod_arch *a, sdm_comm *comm, float *gradient,
                                    sdm_error *err);
