/* The data of a `pod` network in training. Letters as in sdm/internal/pod.h; in addition R is the
 * number of global modes, N of slots in the pool, H of held-out maps. Maps are in block order. */
#pragma once

#include "state/trainer.h"

/* A ridge far below the noise. */
#define POD_RIDGE 1e-6

typedef struct pod_state {
    trainer *t;            /* the run */
    sdm_pod_block *blocks; /* t->blocks; the bases set their ranks */
    sdm_pod_arch arch;

    /* Exponents of the products of polynomials, [n_poly][P]: enough for the F terms of phi and for
       the I inputs of the MLP, which leave out the constant. */
    uint8_t *exponents;
    size_t n_poly;      /* max(F, 1 + I) */
    float *phi;         /* [N][n_poly] products at the parameters of every slot */
    float *holdout_phi; /* [H][n_poly] */

    /* Mean map and local bases, from proper orthogonal decomposition (bases.h). */
    float *mean;       /* [n_voxels] */
    float *basis;      /* [k_b][V_b] of every block of every level in turn */
    size_t *matrix_at; /* [blocks + 1]: block b's matrix is basis[matrix_at[b] ..] */

    /* Global modes (modes.h): the coefficients of the highest level are nearly linear combinations
       of R modes. A polynomial part of the mode coefficients is fitted by least squares. */
    size_t n_modes;   /* R */
    float *modes;     /* [R][K] orthonormal rows */
    float *poly;      /* [R][F] polynomial part */
    double ridge;     /* of the least squares fits, relative to the number of maps */
    float *deviation; /* [K] root mean square of each coefficient of the highest level */
    /* [N][R]: mode coefficients minus their polynomial part, divided by target_scale. The MLP
       learns these. */
    float *target;
    float target_scale;    /* mm sqrt(voxel) */
    float *holdout_target; /* [H][R] */
    /* Mean square error (mm^2) on the held-out maps that remains with exact mode coefficients. */
    double holdout_floor;
    double training_floor; /* the same on maps of the pool */
    double modes_mse;      /* the part of holdout_floor that the modes leave out of the bases */

    /* Trained weights: phase SDM_PHASE_MODE_FIT: MLP, readout[R][W]; phase SDM_PHASE_REFINE: MLP,
       head[K][L] from head_at, mean[n_voxels] from mean_at, basis from basis_at. */
    parameters mode_fit, refine;
    size_t head_at, mean_at, basis_at;
    /* With a budget of time: trainer_seconds() when the mode fit and the refinement end. */
    double mode_fit_end, refine_end;
} pod_state;
