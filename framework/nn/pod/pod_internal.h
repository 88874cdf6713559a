/* The opened pod network and the functions between the files of this folder.

   Words in addition to sdm/internal/pod.h
     integer weights  type SDM_POD_I8: matrices of integers with a scale for each row and a step
                      for each column, w[o][i] = row_scale[o] * integer[o][i] * step[i]
     narrow, wide     an input (column) is narrow if its integer weights have one byte, abs <= 127,
                      and wide if they have two bytes, abs <= SDM_WIDE
     factor           an input of a block is multiplied by its factor before it is rounded:
                      step of its column * row_scale of the row in the matrix above that computes
                      it; row scales are thus never applied to outputs
     limit            largest magnitude of an input as an integer for which no sum overflows:
                      limit * max over o of (sum over i of abs(integer[o][i])) < 2^31
     quantum          value of one unit of the integer inputs of a block, if it is fixed: the same
                      for all maps
     residual         the rounding error of quantised inputs, itself quantised
     survey           evaluation of the network at random parameters before its weights are
                      quantised, which shows how large the coefficients become (pod_survey.c)
     top              a block of the highest level
     leaf             a block of level 0
     slab             a row of tops side by side along x, with all their descendants; a unit of
                      work
     line             the leaves of a slab that lie side by side along x
     group            blocks whose inputs are quantised together: the children of one parent; each
                      top is a group of its own
     padded           rounded up to whole panels, sdm_panel_outputs()

   Letters in addition to sdm/internal/pod.h: C coefficients of all levels together, R rows (a row
   of latents gives one map or one derivative of a map). */
#pragma once

#include "model/model_kind.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"

/* A slab. Its top, leaf and group blocks are the block numbers top .. top_end - 1,
   leaf .. leaf_end - 1 and group .. group_end - 1. */
typedef struct pod_slab {
    uint32_t top, top_end;
    uint32_t leaf, leaf_end; /* pod_network.leaves[leaf .. leaf_end - 1] are its leaves */
    /* One block for each group of leaves: the parents of the leaves, or the leaves themselves if
       the network has one level. */
    uint32_t group, group_end;
    uint32_t coefficient, n_coefficients; /* coefficients of its leaves: first index, number */
} pod_slab;

/* A leaf: its block number, and the index of its group within its slab. */
typedef struct pod_leaf {
    uint32_t block, group;
} pod_leaf;

typedef struct pod_network {
    sdm_pod_arch arch;
    sdm_pod_type type;
    sdm_pod_block *blocks;
    pod_slab *slabs;
    size_t n_slabs;
    pod_leaf *leaves; /* slab by slab; within a slab x is fastest, then y, then z */
    /* products[i]: arguments of the matrix product of leaves[i] (sdm_panel_block): x is the offset
       of its inputs in the coefficients of the slab, y the offset of its outputs in the buffer of
       one line of leaves, and scale is SDM_POD_ROWS times the index of its group in the slab. */
    sdm_panel_block *products;
    uint32_t *outputs;  /* [blocks] V_b, the number of outputs */
    size_t *weights_at; /* [blocks] index in `basis` of the first weight of a block */
    /* Index of the first coefficient of each level among all C; the last entry: C. */
    size_t coefficients_at[SDM_POD_MAX_LEVELS + 1];
    size_t max_outputs[SDM_POD_MAX_LEVELS]; /* largest V_b of a block of the level */
    size_t max_group[SDM_POD_MAX_LEVELS];   /* most coefficients in a group of the level */
    /* Largest number of level-0 coefficients, and of groups of leaves, in a slab. */
    size_t max_slab, max_slab_groups;
    uint8_t *exponents;                   /* [max(F, 1 + I)][P], see sdm_poly_table() */
    const float *bias[SDM_POD_MAX_DEPTH]; /* [layer][W] */
    const float *mean;                    /* mean map in the order of leaves[], each padded */
    /* Weights in panels (sdm/internal/kernels.h). With integer weights all inputs of the MLP are
       wide. `basis` is stored in the order in which the decoder reads it, see
       sdm_pod_place_weights(). */
    const void *layer[SDM_POD_MAX_DEPTH], *head, *basis;

    /* The members below are set for integer weights only. Arrays of C + L elements hold all
       coefficients, then the columns of the head. */
    uint32_t *wide; /* [blocks + 1] number of wide inputs of a block; the last: of the head */
    const uint32_t *order; /* [L] index of the latent that each column of the head multiplies */
    const float *factor;   /* [C + L] factor of each input */
    int limit[SDM_POD_MAX_LEVELS + 1]; /* [levels + 1] limit of a level; the last: of the head */
    const float *quantum;              /* [blocks] quantum of each block's inputs */
    float *to_integer;                 /* [C + SDM_PANEL] factor / quantum */
    const float *layer_scale[SDM_POD_MAX_DEPTH]; /* [layer][W] row scales of the MLP */
    int layer_limit[SDM_POD_MAX_DEPTH];          /* [layer] limit of the inputs of a layer */
} pod_network;

/* Bytes of a stored weight; for integer weights, bytes of a narrow one. */
static inline size_t sdm_pod_weight_bytes(sdm_pod_type type)
{
    return type == SDM_POD_F32 ? 4 : type == SDM_POD_F16 ? 2 : 1;
}

/* Call sdm_panel_f32() or sdm_panel_f16(), or the transpose, with the panels that begin at element
   `at` of `weights`. `type` must not be SDM_POD_I8. */
void sdm_pod_product(sdm_pod_type type, size_t rows, size_t outputs, size_t k, const void *weights,
                     size_t at, const float *x, size_t ldx, float *y, size_t ldy);
void sdm_pod_product_back(sdm_pod_type type, size_t outputs, size_t k, const void *weights,
                          size_t at, const float *y, float *x);

/* Number of elements of a matrix of outputs x k weights, packed in panels of SDM_PANEL outputs. For
   integer weights: number of bytes, where the weights of n_wide of the inputs have two bytes. Both
   are SIZE_MAX on overflow. */
size_t sdm_pod_count_weights(sdm_pod_type type, size_t outputs, size_t n_wide, size_t k);

/* Number of inputs of a layer of the MLP. The two functions after it return the number of elements
   in the panels of one layer, and of all layers. */
static inline size_t sdm_pod_layer_inputs(const sdm_pod_arch *a, size_t layer)
{
    return layer ? a->width : a->n_inputs;
}
size_t sdm_pod_count_layer(sdm_pod_type type, const sdm_pod_arch *a, size_t layer);
size_t sdm_pod_count_mlp(sdm_pod_type type, const sdm_pod_arch *a);

/* Fills slabs[] (room for as many elements as there are tops) and leaves[number of leaves] from the
   blocks, for which sdm_pod_number() must have been called. edge: edge length of a leaf in voxels.
   Returns the number of slabs. */
size_t sdm_pod_slabs(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t edge,
                     pod_slab *slabs, pod_leaf *leaves);

/* at[blocks] = index of the first weight of each block in the stored basis. The basis is stored in
   the order of decoding: slab by slab; within a slab first the levels above 0, depth first, then
   the leaves in the order of leaves[]. wide[blocks]: number of wide inputs of each block; NULL
   unless the weights are integers. Returns the number of elements of the basis. */
size_t sdm_pod_place_weights(sdm_pod_type type, const sdm_pod_levels *levels,
                             const sdm_pod_block *blocks, const pod_slab *slabs, size_t n_slabs,
                             const pod_leaf *leaves, const uint32_t *wide, size_t *at);

/* Number of floats of the stored mean map, in which each leaf is padded. */
size_t sdm_pod_mean_count(const sdm_pod_levels *levels, const sdm_pod_block *blocks);

/* Sets m->products. All other members must have been set. */
void sdm_pod_products_fill(pod_network *m);

/* Number of rows that are decoded together: the kernels compute up to 6 rows at a time. */
enum { SDM_POD_ROWS = 6 };

/* at[l] = number of coefficients of all levels below l; at[levels] = C. sdm_pod_number() must have
   been called. */
void sdm_pod_place_coefficients(const sdm_pod_levels *levels, const sdm_pod_block *blocks,
                                size_t at[SDM_POD_MAX_LEVELS + 1]);

/* Number of wide inputs of the head; 0 unless the weights are integers. */
static inline size_t sdm_pod_head_wide(const pod_network *m)
{
    return m->wide ? m->wide[m->arch.levels.first[m->arch.levels.n]] : 0;
}

/* Calls sdm_quantise() and sets x[r][n] = 0, because sdm_panel_i8() reads one input beyond an odd
   n. */
void sdm_pod_quantise_rows(size_t rows, size_t n, const float *y, size_t ldy, const float *factor,
                           int limit, int16_t *x, size_t ldx, float *scale);

/* Calls sdm_quantise_residual() and sets x[n] = residual[n] = 0. */
void sdm_pod_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                               float *scale, int16_t *residual, float *residual_scale);

/* pod_latent.c: parameters to latents and back. T = max(F, 1 + I) polynomials, D directions. */

/* Scratch memory of sdm_pod_latent() for R rows. */
typedef struct pod_latent {
    float *phi;        /* [R][T] polynomials, then their derivatives along the directions */
    float *h[2];       /* [R + 1][padded W] outputs of two layers in turn; the last row: residual */
    float *slope;      /* [depth][padded W] derivative of the activation */
    float *dphi;       /* [P][T] derivatives of the polynomials by each parameter */
    int16_t *integers; /* integer weights: [R + 1][ld] inputs of a layer */
    float *scale;      /* integer weights: [R + 1] scale of each row of `integers` */
    size_t ld;         /* elements from one row of `integers` to the next */
} pod_latent;

/* Sets the pointers of *w into memory[] (NULL: none) for R rows; returns the floats needed. */
size_t sdm_pod_latent_carve(const pod_network *m, size_t rows, float *memory, pod_latent *w);

/* z[n][L] = the latents at the parameters p[n][P]. With n_directions = D > 0, n must be 1, and rows
   1 .. D of z[1 + D][L] are the derivatives of the latents along direction[D][P]. */
void sdm_pod_latent(const sdm_model *model, const double *p, size_t n, size_t n_directions,
                    const double *direction, const pod_latent *w, float *z);

/* gradient[P] = (dz / dp)^T dz[L], at the parameters p of the last sdm_pod_latent() with this w. */
void sdm_pod_latent_back(const sdm_model *model, const double *p, const pod_latent *w,
                         const float *dz, double *gradient);

/* pod_decode.c: latents to maps. */

/* Scratch memory of sdm_pod_decode() for R rows. */
typedef struct pod_scratch {
    float *z; /* [R][L] latents, set by the caller */
    /* [R + 1][padded K] coefficients of the highest level (the last row: residual), as floats or,
       in the same memory, as integers whose rows are 2 * padded K apart. */
    float *c;
    float *sorted;       /* integer weights: latents or inputs of a block, in column order */
    int16_t *z_integers; /* integer weights: [R + 1][ldz] latents as integers */
    float *z_scale;      /* integer weights: [R + 1] scale of each row of z_integers */
    size_t ldz;          /* elements from one row of z_integers to the next */
    float *threads;      /* [threads][per_thread] memory of the slab_scratch of each thread */
    size_t per_thread;   /* floats */
} pod_scratch;

/* Sets the pointers of *w into memory[] (NULL: none); returns the floats needed. */
size_t sdm_pod_scratch_carve(const pod_network *m, size_t rows, int n_threads, float *memory,
                             pod_scratch *w);

/* maps[R][voxels] = the decoder applied to the rows of w->z; the mean map is added to the first
   with_mean rows. stream: as in sdm_copy(). n_threads >= 1.

   `smooth` matters for integer weights only. smooth = false quantises inputs with the fixed quantum
   of each block, which is fastest; inputs beyond the limit are clipped. smooth = true computes a
   scale for each row and group, and adds the residual of the first row: the first map then changes
   smoothly with the parameters, as its derivatives require, and inputs may have any size. */
void sdm_pod_decode(const pod_network *m, const sdm_grid *grid, size_t rows, size_t with_mean,
                    bool smooth, bool stream, float *const *maps, const pod_scratch *w,
                    int n_threads);

/* pod_decode_back.c: dz[L] = the transpose of the decoder applied to adjoint[nz][ny][nx]. w:
   scratch memory for one row or more. Runs in the calling thread. */
void sdm_pod_decode_back(const pod_network *m, const sdm_grid *grid, const float *adjoint,
                         const pod_scratch *w, float *dz);

/* pod_forward.c: entries of the function table sdm_model_kind. */
size_t sdm_pod_scratch_bytes(const sdm_model *m, size_t n, int n_threads);
void sdm_pod_forward(const sdm_model *m, const double *params, size_t n, float *values,
                     void *scratch, int n_threads);
size_t sdm_pod_jacobian_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_pod_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                      void *scratch, int n_threads);
size_t sdm_pod_jvp_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_pod_jvp(const sdm_model *m, const double *params, const double *direction, float *values,
                 float *tangent, void *scratch, int n_threads);
size_t sdm_pod_vjp_scratch_bytes(const sdm_model *m);
void sdm_pod_vjp(const sdm_model *m, const double *params, const float *adjoint, double *gradient,
                 void *scratch);

/* pod_onnx.c: entry of the function table. */
sdm_onnx_value sdm_pod_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x);
