/* The `pod` network: polynomials and an MLP give the coefficients of nested local bases of the map.

     x   = parameters scaled to [-1, 1]
     phi = products of normalised Legendre polynomials of total degree <= degree        (polynomial
   chaos; Xiu and Karniadakis 2002) h   = MLP(products of total degree 1 .. input_degree) z   =
   [phi, h]                                        "latent", n_latent numbers c   = head z
   coefficients of the blocks of the highest level y   = c_b basis_b in each block b: above the
   lowest level y are the coefficients of the blocks it is made of (2 x 2 x 2), on the lowest level
   y + mean is the map there   (proper orthogonal decomposition; POD-NN, Hesthaven and Ubbiali 2018;
           nested as in hierarchical Tucker and H2 matrices, Hackbusch and Boerm 2002)

   Letters: P parameters, F terms of phi, I inputs of the MLP, W width, L = F + W latent, K
   coefficients of the highest level, V_b outputs (voxels, or coefficients of the blocks below) and
   k_b rank of block b. */
#ifndef SDM_POD_H
#define SDM_POD_H

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_POD_MAX_DEPTH 16
#define SDM_POD_MAX_PARAMS 64

/* Number of products of total degree <= degree in n variables; SIZE_MAX when it does not fit. */
size_t sdm_poly_count(size_t n, size_t degree);

/* exponents[sdm_poly_count(n, degree)][n], ordered by total degree, so that lower degrees are a
 * prefix; entry 0 is the constant. */
void sdm_poly_table(size_t n, size_t degree, uint8_t *exponents);

/* phi[n_terms] at x[n] in [-1, 1]; dphi[n][n_terms] = d phi / d x when not NULL. Normalised: mean
   square 1 under the uniform law. degree: the largest exponent in the table. */
void sdm_poly_eval(const uint8_t *exponents, size_t n_terms, size_t n, size_t degree,
                   const double *x, float *phi, float *dphi);

/* Activation: y = f(x) and, when dy is not NULL, dy = f'(x), for n values. kind: 0 SiLU, 1 tanh, 2
   ReLU, 3 leaky ReLU (slope 0.02 below 0; Chen and Zhang 2019). y may be x. */
void sdm_activate(int kind, size_t n, const float *x, float *y, float *dy);

#define SDM_POD_MAX_LEVELS 8

/* A block of voxels: first voxel and size along x, y, z, the blocks of the level below that it is
   made of, and its place in the arrays that hold all blocks of a level one after another. */
typedef struct sdm_pod_block {
    uint32_t at[3], size[3];
    uint32_t rank;
    uint32_t child, n_children; /* first in the array of blocks, number; 0 on the lowest level */
    uint32_t coefficient;       /* first of its coefficients among those of its level */
    uint64_t voxel;             /* first of its voxels in block order */
} sdm_pod_block;

/* Number of voxels of a block. */
static inline size_t sdm_pod_block_voxels(const sdm_pod_block *b)
{
    return (size_t)b->size[0] * b->size[1] * b->size[2];
}

/* The blocks of a grid: edge `block` on the lowest level, twice that on each level above, those at
 * the grid's end smaller. */
typedef struct sdm_pod_levels {
    size_t n;                             /* levels, 1 .. SDM_POD_MAX_LEVELS */
    size_t first[SDM_POD_MAX_LEVELS + 1]; /* blocks of level l: first[l] .. first[l + 1] - 1 */
} sdm_pod_levels;

/* Counts them; levels above one that is a single block are left out. first[n]: blocks in all. */
sdm_pod_levels sdm_pod_count(const sdm_grid *grid, size_t block, size_t levels);

/* blocks[first[n]], rank and coefficient 0. Level by level; on the highest x is fastest, on the
   others the children of a block follow one another, parents in order: so the descendants of a
   block are neighbours on every level, in voxels too. */
void sdm_pod_blocks(const sdm_grid *grid, size_t block, const sdm_pod_levels *levels,
                    sdm_pod_block *blocks);

/* Sets `coefficient` from the ranks. */
void sdm_pod_number(const sdm_pod_levels *levels, sdm_pod_block *blocks);

/* Number of outputs V_b of block b, after sdm_pod_number(). */
size_t sdm_pod_outputs(const sdm_pod_block *blocks, size_t b);

/* What a pod network is made of, beside its weights. */
typedef struct sdm_pod_arch {
    size_t n_params, degree, input_degree, depth, width;
    size_t block; /* edge of a block of the lowest level, voxels */
    int activation;
    size_t n_terms, n_inputs, n_latent;
    size_t n_coefficients, n_voxels;
    sdm_pod_levels levels;
} sdm_pod_arch;

/* A map [nz][ny][nx] in block order (x fastest within a block); blocks of the lowest level. */
void sdm_pod_gather(const sdm_grid *grid, const sdm_pod_block *blocks, size_t n_blocks,
                    const float *map, float *blocked);

/* Weights as the trainer has them, row-major float32. */
typedef struct sdm_pod_weights {
    const float *layer[SDM_POD_MAX_DEPTH]; /* [W][I or W] */
    const float *bias[SDM_POD_MAX_DEPTH];  /* [W] */
    const float *head;                     /* [K][L] */
    const float *mean;                     /* [n_voxels], block order */
    const float *basis; /* for each block of all levels [k_b][V_b], one after another */
} sdm_pod_weights;

/* How weights are stored. Bytes: with a second byte where one is not enough; maps are for
   parameters within their ranges, beyond them what becomes too large is clipped. */
typedef enum sdm_pod_type { SDM_POD_F32 = 0, SDM_POD_F16 = 1, SDM_POD_I8 = 2 } sdm_pod_type;

/* Everything a model file is made from. `info` gives names, ranges, grid, accuracy, provenance. */
typedef struct sdm_pod_spec {
    const sdm_model_info *info;
    sdm_pod_arch arch;
    const sdm_pod_block *blocks;
    sdm_pod_weights weights;
    sdm_pod_type type;
} sdm_pod_spec;

/* Builds a model file in memory (sdm_free()); write it with sdm_container_write(). SDM_E_NOMEM. */
sdm_status sdm_pod_build(const sdm_pod_spec *spec, uint8_t **bytes, size_t *size, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
