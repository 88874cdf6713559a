/* The head: the linear layer from the latent variables z = [phi, h] to the coefficients of the
 * highest level; phi are products of polynomials, h is the output of the MLP. */
#pragma once

#include "pod_state.h"

/* z[rows][L] = latent variables for the polynomial products phi[i][n_poly] of each row and the MLP
   weights w. x[rows][I] receives the inputs of the MLP, workspace (trainer_mlp_workspace()) its
   activations. */
void trainer_head_latent(const pod_state *pod, const float *w, size_t rows, const float *const *phi,
                         float *x, float *z, float *workspace);

/* The normal equations of the head, over all maps of the pool. */
typedef struct head_equations {
    size_t maps;  /* number of maps */
    float *gram;  /* [L][L] z^T z */
    float *right; /* [L][K] z^T y, y the coefficients of the highest level; of these, the columns
                    sdm_comm_own(K) of the rank alone */
} head_equations;

/* Sets *e for the MLP weights w. All ranks call it together, as trainer_head_solve(). Call
 * trainer_head_equations_dispose() also after an error. */
sdm_status trainer_head_equations(const pod_state *pod, const float *w, head_equations *e,
                                  sdm_error *err);
void trainer_head_equations_dispose(head_equations *e);

/* head[K][L] = the network of the mode fit (averaged weights) as a head: modes times polynomials
   and readout. */
sdm_status trainer_head_of_modes(const pod_state *pod, float *head, sdm_error *err);

/* head[K][L] = the head with the smallest sum of squared errors plus ridge * maps * |head -
   prior|^2; prior NULL: zeros. */
sdm_status trainer_head_solve(const pod_state *pod, const head_equations *e, double ridge,
                              const float *prior, float *head, sdm_error *err);
