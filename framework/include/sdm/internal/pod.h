/* The `pod` network (proper orthogonal decomposition): polynomials and a multi-layer perceptron of
   the parameters give the coefficients of nested local bases of the map.

     x   = parameters scaled to [-1, 1]
     phi = products of normalised Legendre polynomials of total degree <= degree
           (polynomial chaos; Xiu and Karniadakis 2002)
     h   = MLP(products of total degree 1 .. input_degree)
     z   = [phi, h]           latent variables
     c   = head z             coefficients of the blocks of the highest level
     y   = basis_b^T c_b      outputs of each block b, from the highest level down:
                              above the lowest level, the coefficients of the children of b;
                              on the lowest level, the map in b minus the mean map
           (POD-NN, Hesthaven and Ubbiali 2018; nested bases as in hierarchical Tucker tensors and
           H2 matrices, Hackbusch and Boerm 2002)

   Words
     block        a box of voxels of the grid
     level        blocks of one edge length that tile the grid; level 0 is the lowest, each higher
                  level doubles the edge: 2 x 2 x 2 children (fewer at the border) make a parent
     mode         one vector of outputs of a block, learnt from exact maps
     basis        the modes of a block; their number is the rank of the block
     coefficient  the factor of a mode in the sum of modes that gives a block's outputs
     outputs      what a block's basis gives: voxels on level 0, else coefficients of its children
     latent       a component of z
     head         the matrix from z to the coefficients of the highest level
     mean map     the average of the exact maps of the training
     block order  the voxels of one level-0 block after another, x fastest within a block

   Letters: P parameters, F terms of phi, I inputs of the MLP, W its width, L = F + W latents (F
   without an MLP), K coefficients of the highest level; of block b: V_b outputs, k_b rank. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_POD_MAX_DEPTH 16
#define SDM_POD_MAX_PARAMS 64

/* Number of products of total degree <= degree in n variables; SIZE_MAX on overflow. */
size_t sdm_poly_count(size_t n, size_t degree);

/* exponents[sdm_poly_count(n, degree)][n]: the degree of each variable in each product,
   1 <= n <= SDM_POD_MAX_PARAMS. Ordered by total degree, so that the products of a lower total
   degree are a prefix; entry 0 is the constant. */
void sdm_poly_table(size_t n, size_t degree, uint8_t *exponents);

/* phi[n_terms] = the products at x[n], and, unless dphi is NULL, dphi[n][n_terms] = d phi / d x.
   Each product is normalised: its mean square is 1 for x uniform in [-1, 1]^n. degree: the largest
   exponent in the table, at most 16. [any thread] */
void sdm_poly_eval(const uint8_t *exponents, size_t n_terms, size_t n, size_t degree,
                   const double *x, float *phi, float *dphi);

/* Activation function: y[n] = f(x[n]), and dy[n] = f'(x[n]) unless dy is NULL. kind: 0 SiLU,
   1 tanh, 2 ReLU, 3 leaky ReLU (slope 0.02 for x < 0; Chen and Zhang 2019),
   4 x / 2 (1 + x / sqrt(1 + x^2)), for the fine level. y may be x. [any thread] */
void sdm_activate(int kind, size_t n, const float *x, float *y, float *dy);

#define SDM_POD_MAX_LEVELS 8

/* A block: its box of voxels, its rank, its children, and its offsets in arrays that hold data of
   all blocks of a level one after another. */
typedef struct sdm_pod_block {
    uint32_t at[3], size[3]; /* first voxel and number of voxels along x, y, z */
    uint32_t rank;
    uint32_t child, n_children; /* index of the first child, number of children; 0 on level 0 */
    uint32_t coefficient;       /* index of its first coefficient among those of its level */
    uint64_t voxel;             /* index of its first voxel in block order of its level */
} sdm_pod_block;

/* Number of voxels of a block. */
static inline size_t sdm_pod_block_voxels(const sdm_pod_block *b)
{
    return (size_t)b->size[0] * b->size[1] * b->size[2];
}

/* The index at which each level begins in an array of all blocks. */
typedef struct sdm_pod_levels {
    size_t n;                             /* levels, 1 .. SDM_POD_MAX_LEVELS */
    size_t first[SDM_POD_MAX_LEVELS + 1]; /* blocks of level l: first[l] .. first[l + 1] - 1 */
} sdm_pod_levels;

/* Counts the blocks of a grid whose level-0 blocks have an edge of `block` voxels. The result has
   min(levels, SDM_POD_MAX_LEVELS) levels, or fewer if a lower level has only one block: that level
   is then the highest. first[n] = number of all blocks. */
sdm_pod_levels sdm_pod_count(const sdm_grid *grid, size_t block, size_t levels);

/* Fills blocks[first[n]], with rank and coefficient 0; blocks at the end of the grid are smaller.
   The highest level is ordered with x fastest. On the other levels the children of a block are
   contiguous, in the order of their parents; hence all descendants of a block on one level are
   contiguous, and so are the voxels of these descendants in block order. */
void sdm_pod_blocks(const sdm_grid *grid, size_t block, const sdm_pod_levels *levels,
                    sdm_pod_block *blocks);

/* Sets `coefficient` of all blocks from their ranks. */
void sdm_pod_number(const sdm_pod_levels *levels, sdm_pod_block *blocks);

/* V_b, the number of outputs of block b. sdm_pod_number() must have been called. */
size_t sdm_pod_outputs(const sdm_pod_block *blocks, size_t b);

/* Sizes of a pod network: n_params = P, n_terms = F, n_inputs = I, n_latent = L,
   n_coefficients = K. */
typedef struct sdm_pod_arch {
    size_t n_params, degree, input_degree;
    size_t depth, width; /* layers of the MLP, 0 .. SDM_POD_MAX_DEPTH, and units of each */
    size_t block;        /* edge of a block of level 0, voxels */
    int activation;      /* activation of the MLP: `kind` of sdm_activate() */
    size_t n_terms, n_inputs, n_latent;
    size_t n_coefficients, n_voxels;
    sdm_pod_levels levels;
} sdm_pod_arch;

/* blocked[voxels] = map[nz][ny][nx] in block order; blocks[n_blocks]: all blocks of level 0. */
void sdm_pod_gather(const sdm_grid *grid, const sdm_pod_block *blocks, size_t n_blocks,
                    const float *map, float *blocked);

/* The weights as floats, matrices row-major; owned by the caller. */
typedef struct sdm_pod_weights {
    const float *layer[SDM_POD_MAX_DEPTH]; /* [layer][W][inputs], I inputs for layer 0, else W */
    const float *bias[SDM_POD_MAX_DEPTH];  /* [layer][W] */
    const float *head;                     /* [K][L] */
    const float *mean;                     /* [n_voxels], block order */
    const float *basis;                    /* [k_b][V_b], block after block, all levels */
} sdm_pod_weights;

/* How weights are stored: floats, halves, or integers of one byte (two bytes where the error would
   be too large). With integers, coefficients beyond a limit are clipped, which must be expected at
   parameters outside their ranges. */
typedef enum sdm_pod_type { SDM_POD_F32 = 0, SDM_POD_F16 = 1, SDM_POD_I8 = 2 } sdm_pod_type;

/* Content of a model file. `info` gives shape, parameters, options, grid, accuracy, training and
   configuration. `blocks` have ranks and coefficient offsets. All pointers belong to the caller. */
typedef struct sdm_pod_spec {
    const sdm_model_info *info;
    sdm_pod_arch arch;
    const sdm_pod_block *blocks;
    sdm_pod_weights weights;
    sdm_pod_type type;
} sdm_pod_spec;

/* *bytes = a model file of *size bytes, to be freed with sdm_free() and written with
   sdm_container_write(). SDM_E_NOMEM. [any thread] */
sdm_status sdm_pod_build(const sdm_pod_spec *spec, uint8_t **bytes, size_t *size, sdm_error *err);

#ifdef __cplusplus
}
#endif
