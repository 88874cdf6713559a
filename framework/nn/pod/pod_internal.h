/* The opened pod network and the functions between the files of this folder.

      Words in addition to sdm/internal/pod.h:
     integer weights  type SDM_POD_I8: matrices of integers with scales for rows and columns,
                      w[o][i] = row_scale[o] * integer[o][i] * step[i]
          narrow, wide     an input (column) whose integer weights have one byte, abs <= 127, or two
                      bytes, abs <= SDM_WIDE
     factor           of an input of a block: step of its column * row_scale of the row in the
                      matrix above that computes it; so row scales are never applied to outputs
     limit            largest magnitude of an input as an integer, such that no sum of 32 bits
                      overflows: limit * max over o of (sum over i of abs(integer[o][i])) < 2^31
     quantum          value of one unit of the inputs of a block when all maps use the same unit
          residual         the rounding error of quantised inputs, itself quantised
     survey           the network evaluated at random parameters before its weights are quantised,
                      which shows how large the coefficients become (pod_survey.c)
     top              a block of the highest level
     leaf             a block of level 0
     slab             the tops side by side along x with all their descendants; a unit of work
     line             the leaves of a slab side by side along x
     group            blocks whose inputs are quantised together: the children of one parent; each
                      top is a group of its own
     padded           rounded up to whole panels, sdm_panel_outputs()

      Letters in addition to sdm/internal/pod.h: C coefficients of all levels, R rows (a row of
   latents gives one map or the derivative of one). */
#ifndef SDM_POD_INTERNAL_H
#define SDM_POD_INTERNAL_H

#include "model/model_kind.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"

/* A slab: ranges first .. end - 1 of block numbers. */
typedef struct pod_slab {
    uint32_t top, top_end;
    uint32_t leaf, leaf_end; /* the same range of pod_network.leaves[] holds its leaves */
    /* The parents of its leaves, one for each group of leaves; with one level, its leaves. */
    uint32_t group, group_end;
    uint32_t coefficient, n_coefficients; /* of level 0: index of the first, number */
} pod_slab;

/* A leaf, and the index of its group within its slab. */
typedef struct pod_leaf {
    uint32_t block, group;
} pod_leaf;

typedef struct pod_network {
    sdm_pod_arch arch;
    sdm_pod_type type;
    sdm_pod_block *blocks;
    pod_slab *slabs;
    size_t n_slabs;
    pod_leaf *leaves; /* slab by slab, in each with x fastest, then y, then z */
    /* The product of each of leaves[]. Offsets x: within the coefficients of the slab, y: within
       the line, scale: group * SDM_POD_ROWS. */
    sdm_panel_block *products;
    uint32_t *outputs;  /* [blocks] V_b */
    size_t *weights_at; /* [blocks] index of the first weight of a block in basis */
    /* Index of the first coefficient of each level among all C; the last entry: C. */
    size_t coefficients_at[SDM_POD_MAX_LEVELS + 1];
    size_t max_outputs[SDM_POD_MAX_LEVELS]; /* of a block of the level */
    size_t max_group[SDM_POD_MAX_LEVELS];   /* coefficients of a group of the level */
    size_t max_slab, max_slab_groups;       /* coefficients of level 0 and groups of a slab */
    uint8_t *exponents;                     /* [max(F, 1 + I)][P] */
    const float *bias[SDM_POD_MAX_DEPTH];   /* [W] */
    const float *mean;                      /* mean map in the order of leaves[], each padded */
    /* Panels (sdm/internal/kernels.h). With integer weights all inputs of the MLP are wide. The
       basis lies in the order in which it is read, see sdm_pod_place_weights(). */
    const void *layer[SDM_POD_MAX_DEPTH], *head, *basis;

    /* For integer weights only; C + L: all coefficients, then the columns of the head. */
    uint32_t *wide;                              /* [blocks + 1] wide inputs; last: of the head */
    const uint32_t *order;                       /* [L] latent of each column of the head */
    const float *factor;                         /* [C + L] */
    int limit[SDM_POD_MAX_LEVELS + 1];           /* of each level; the last: of the head */
    const float *quantum;                        /* [blocks] */
    float *to_integer;                           /* [C + SDM_PANEL] factor / quantum */
    const float *layer_scale[SDM_POD_MAX_DEPTH]; /* [W] row scales of the MLP */
    int layer_limit[SDM_POD_MAX_DEPTH];          /* limits of the MLP */
} pod_network;

/* Bytes of a stored weight; of a narrow one for integers. */
static inline size_t sdm_pod_weight_bytes(sdm_pod_type type)
{
    return type == SDM_POD_F32 ? 4 : type == SDM_POD_F16 ? 2 : 1;
}

/* sdm_panel_f32(), sdm_panel_f16() and their transposes with the panels at element `at` of
   `weights`; not for integer weights. */
void sdm_pod_product(sdm_pod_type type, size_t rows, size_t outputs, size_t k, const void *weights,
                     size_t at, const float *x, size_t ldx, float *y, size_t ldy);
void sdm_pod_product_back(sdm_pod_type type, size_t outputs, size_t k, const void *weights,
                          size_t at, const float *y, float *x);

/* Elements (bytes for integer weights) of the panels of outputs x k weights; n_wide: for integer
   weights. SIZE_MAX on overflow for integer weights. */
size_t sdm_pod_count_weights(sdm_pod_type type, size_t outputs, size_t n_wide, size_t k);

/* Number of inputs of a layer of the MLP, and elements of the panels of a layer and of all
   layers. */
static inline size_t sdm_pod_layer_inputs(const sdm_pod_arch *a, size_t layer)
{
    return layer ? a->width : a->n_inputs;
}
size_t sdm_pod_count_layer(sdm_pod_type type, const sdm_pod_arch *a, size_t layer);
size_t sdm_pod_count_mlp(sdm_pod_type type, const sdm_pod_arch *a);

/* Fills slabs[], with room for the number of tops, and leaves[number of leaves], from blocks after
   sdm_pod_number(). edge: of a leaf, voxels. Returns the number of slabs. */
size_t sdm_pod_slabs(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t edge,
                     pod_slab *slabs, pod_leaf *leaves);

/* at[blocks] = index of the first weight of each block in the stored basis, in the order of
   decoding: slab by slab, in each the levels above 0 depth first, then the leaves as in leaves[].
   wide[blocks]: for integer weights, else NULL. Returns the number of elements of the basis. */
size_t sdm_pod_place_weights(sdm_pod_type type, const sdm_pod_levels *levels,
                             const sdm_pod_block *blocks, const pod_slab *slabs, size_t n_slabs,
                             const pod_leaf *leaves, const uint32_t *wide, size_t *at);

/* Floats of the stored mean map, in which each leaf is padded. */
size_t sdm_pod_mean_count(const sdm_pod_levels *levels, const sdm_pod_block *blocks);

/* Sets m->products when all other members are set. */
void sdm_pod_products_fill(pod_network *m);

/* Rows that are decoded together: the kernels compute up to 6 rows at a time. */
enum { SDM_POD_ROWS = 6 };

/* at[l] = number of coefficients of the levels below l, after sdm_pod_number(); at[levels] = C. */
void sdm_pod_place_coefficients(const sdm_pod_levels *levels, const sdm_pod_block *blocks,
                                size_t at[SDM_POD_MAX_LEVELS + 1]);

/* Wide inputs of the head; 0 unless weights are integers. */
static inline size_t sdm_pod_head_wide(const pod_network *m)
{
    return m->wide ? m->wide[m->arch.levels.first[m->arch.levels.n]] : 0;
}

/* sdm_quantise(), and x[r][n] = 0: sdm_panel_i8() reads one input beyond an odd n. */
void sdm_pod_quantise_rows(size_t rows, size_t n, const float *y, size_t ldy, const float *factor,
                           int limit, int16_t *x, size_t ldx, float *scale);

/* sdm_quantise_residual(), and x[n] = residual[n] = 0. */
void sdm_pod_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                               float *scale, int16_t *residual, float *residual_scale);

/* pod_latent.c: parameters to latents and back. T = max(F, 1 + I) polynomials, D directions. */

/* Scratch memory for R rows. */
typedef struct pod_latent {
    float *phi;        /* [R][T] polynomials, then their derivatives along the directions */
    float *h[2];       /* [R + 1][padded W] outputs of two layers in turn; the last row: residual */
    float *slope;      /* [depth][padded W] derivative of the activation */
    float *dphi;       /* [P][T] derivatives of the polynomials by each parameter */
    int16_t *integers; /* integer weights: [R + 1][ld] inputs of a layer */
    float *scale;      /* integer weights: [R + 1] scales of these inputs */
    size_t ld;
} pod_latent;

/* Sets the pointers of *w into memory[] (NULL: none) for R rows; returns the floats needed. */
size_t sdm_pod_latent_carve(const pod_network *m, size_t rows, float *memory, pod_latent *w);

/* z[n][L] = the latents at p[n][P]. With n_directions = D > 0, n is 1 and z[1 + D][L] also gets the
   derivatives along direction[D][P]. */
void sdm_pod_latent(const sdm_model *model, const double *p, size_t n, size_t n_directions,
                    const double *direction, const pod_latent *w, float *z);

/* gradient[P] = (dz / dp)^T dz[L], at the parameters p of the last sdm_pod_latent() with this w. */
void sdm_pod_latent_back(const sdm_model *model, const double *p, const pod_latent *w,
                         const float *dz, double *gradient);

/* pod_decode.c: latents to maps. */

/* Scratch memory for R rows. */
typedef struct pod_scratch {
    float *z; /* [R][L] latents, set by the caller */
    /* [R + 1][padded K] coefficients of the highest level (the last row: residual), as floats or,
       in the same memory, as integers whose rows are 2 * padded K apart. */
    float *c;
    float *sorted;       /* integer weights: latents or inputs of a block, by column */
    int16_t *z_integers; /* integer weights: [R + 1][ldz] */
    float *z_scale;      /* integer weights: [R + 1] */
    size_t ldz;
    float *threads; /* [threads][per_thread] slab_scratch of each thread */
    size_t per_thread;
} pod_scratch;

/* Sets the pointers of *w into memory[] (NULL: none); returns the floats needed. */
size_t sdm_pod_scratch_carve(const pod_network *m, size_t rows, int n_threads, float *memory,
                             pod_scratch *w);

/* maps[R][voxels] = the decoder applied to the rows of w->z; the mean map is added to the first
   with_mean rows. stream: as sdm_copy(). n_threads >= 1.

   With integer weights: smooth = false quantises inputs with the fixed quantum of each block, which
   is fastest; inputs beyond the limit are clipped. smooth = true uses a scale for each row and
   group, and adds the residual of the first row: the first map then changes smoothly with the
   parameters, as derivatives need it, and inputs may have any size. */
void sdm_pod_decode(const pod_network *m, const sdm_grid *grid, size_t rows, size_t with_mean,
                    bool smooth, bool stream, float *const *maps, const pod_scratch *w,
                    int n_threads);

/* pod_decode_back.c: dz[L] = the transpose of the decoder applied to adjoint[nz][ny][nx]. w:
   scratch memory for one row or more. One thread. */
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

#endif
