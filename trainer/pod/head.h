/* The head: the linear layer from the latent variables z = [phi, h] to the coefficients of the
 * highest level; phi are products of polynomials, h is the output of the MLP. */
#pragma once

#include "pod_state.h"

/* z[rows][L] = latent variables for the polynomial products phi[i][n_poly] of each row and the MLP
   weights w. x[rows][I] receives the inputs of the MLP, workspace (trainer_mlp_workspace()) its
   activations. */
void trainer_head_latent(const pod_state *pod, const float *w, size_t rows, const float *const *phi,
                         float *x, float *z, float *workspace);

/* head[K][L] = least squares solution that maps the latent variables of all maps in the pool to
   their coefficients, for MLP weights w. */
sdm_status trainer_head_solve(const pod_state *pod, const float *w, float *head, sdm_error *err);
