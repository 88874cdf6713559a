/* Passes of a batch through the perceptron that ranks (sdm/internal/comm.h) share. In the forward
   and backward pass each has rows of the batch, in the gradient by the weights each has units of
   every layer: so each sum is that of one rank, in the order in which a single process computes it.
 */
#pragma once

#include "mlp.h"
#include "sdm/internal/comm.h"

/* Rows of a batch or units of a layer: first .. end - 1. */
typedef struct mlp_part {
    size_t first, end;
} mlp_part;

/* Those of this rank, of n. */
mlp_part trainer_mlp_part(const sdm_comm *comm, size_t n);

/* As trainer_mlp_forward(), for some rows. Returns h[B][W]. */
const float *trainer_mlp_forward_rows(const sdm_pod_arch *a, const float *weights, size_t batch,
                                      mlp_part rows, const float *x, float *workspace,
                                      int n_threads);

/* The part of trainer_mlp_backward() down to the inputs, for some rows. */
void trainer_mlp_backward_rows(const sdm_pod_arch *a, const float *weights, size_t batch,
                               mlp_part rows, float *workspace, const float *dh, int n_threads);

/* Gives all ranks all rows, after the two functions above. */
sdm_status trainer_mlp_gather_rows(const sdm_pod_arch *a, sdm_comm *comm, size_t batch,
                                   float *workspace, sdm_error *err);

/* The rest of trainer_mlp_backward(): the gradient by the weights of some units of each layer. */
void trainer_mlp_gradient_units(const sdm_pod_arch *a, size_t batch, mlp_part units, const float *x,
                                float *workspace, float *gradient, int n_threads);

/* Gives all ranks the gradient by the weights of all units. */
sdm_status trainer_mlp_gather_units(const sdm_pod_arch *a, sdm_comm *comm, float *gradient,
                                    sdm_error *err);
