/* The opened pod network. */
#ifndef SDM_POD_INTERNAL_H
#define SDM_POD_INTERNAL_H

#include "model/model_kind.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"

/* Blocks of the highest level that lie side by side along x, and all below them: numbers of blocks,
 * first and behind the last. */
typedef struct pod_slab {
    uint32_t top, top_end;
    uint32_t leaf, leaf_end;   /* of the lowest level; also their places in pod_network.leaves */
    uint32_t group, group_end; /* blocks that give the coefficients of the lowest level: above it,
                                  or of it where it is the highest */
    uint32_t coefficient, n_coefficients; /* of the lowest level */
} pod_slab;

/* A block of the lowest level, and which of its slab's groups it belongs to. */
typedef struct pod_leaf {
    uint32_t block, group;
} pod_leaf;

typedef struct pod_network {
    sdm_pod_arch arch;
    sdm_pod_type type;
    sdm_pod_block *blocks;
    pod_slab *slabs;
    size_t n_slabs;
    pod_leaf *leaves; /* slab by slab, along x, then y, then z */
    /* What the decoder needs of leaves[], in the order in which it is read. x: among the
     * coefficients of a slab, y: along a line of blocks. */
    sdm_panel_block *products;
    uint32_t *outputs;  /* [blocks] V_b */
    size_t *weights_at; /* [blocks] where the weights of a block begin in basis */
    /* Where the coefficients of a level begin among all; the last: their number C. */
    size_t coefficients_at[SDM_POD_MAX_LEVELS + 1];
    size_t max_outputs[SDM_POD_MAX_LEVELS];
    /* Most coefficients of a level that are made together: of the highest those of a block, of the
     * others those of a block's children. */
    size_t max_group[SDM_POD_MAX_LEVELS];
    size_t max_slab,
        max_slab_groups; /* most coefficients of the lowest level, and groups, of a slab */
    uint8_t *exponents;  /* [max(F, 1 + I)][P] */
    const float *bias[SDM_POD_MAX_DEPTH]; /* [W] */
    const float *mean;                    /* leaf by leaf, each filled up to whole panels */
    /* Panels (sdm/kernels.h), the MLP's of two bytes when the others are bytes. The basis in the
     * order in which it is read (sdm_pod_place_weights()). */
    const void *layer[SDM_POD_MAX_DEPTH], *head, *basis;
    /* Bytes only (pod_quantise.h). */
    uint32_t *wide;                    /* [blocks + 1] the last: of the head */
    const uint32_t *order;             /* [L] */
    const float *factor;               /* [C + L] */
    int limit[SDM_POD_MAX_LEVELS + 1]; /* of inputs of a level as integers; the last: of the head */
    const float *quantum; /* [blocks] value of 1 of the integers that go into a block */
    float *to_integer;    /* [C + SDM_PANEL] factor / quantum */
    const float *layer_scale[SDM_POD_MAX_DEPTH]; /* [W] */
    int layer_limit[SDM_POD_MAX_DEPTH];          /* of inputs of a layer as integers */
} pod_network;

/* Bytes of a stored number. */
static inline size_t sdm_pod_size(sdm_pod_type type)
{
    return type == SDM_POD_F32 ? 4 : type == SDM_POD_F16 ? 2 : 1;
}

/* y[rows][ldy] = x[rows][ldx] times float or half weights that begin at `at`, as sdm_panel_*(); and
 * the transpose. */
void sdm_pod_product(sdm_pod_type type, size_t rows, size_t outputs, size_t k, const void *weights,
                     size_t at, const float *x, size_t ldx, float *y, size_t ldy);
void sdm_pod_product_back(sdm_pod_type type, size_t outputs, size_t k, const void *weights,
                          size_t at, const float *y, float *x);

/* Stored numbers of a matrix of `outputs` x k; n_wide: for bytes. */
size_t sdm_pod_count_weights(sdm_pod_type type, size_t outputs, size_t n_wide, size_t k);

/* Stored numbers of a layer of the MLP, and of all. */
static inline size_t sdm_pod_layer_inputs(const sdm_pod_arch *a, size_t layer)
{
    return layer ? a->width : a->n_inputs;
}
size_t sdm_pod_count_layer(sdm_pod_type type, const sdm_pod_arch *a, size_t layer);
size_t sdm_pod_count_mlp(sdm_pod_type type, const sdm_pod_arch *a);

/* Slabs and leaves from blocks that are numbered; slabs[] has room for the blocks of the highest
   level, leaves[] for those of the lowest. edge: of a block of the lowest level. Returns the number
   of slabs. */
size_t sdm_pod_slabs(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t edge,
                     pod_slab *slabs, pod_leaf *leaves);

/* at[blocks] = where the weights of each block begin, slab by slab: the levels above the lowest
   depth first, then the leaves. wide[blocks]: for bytes. Returns their number. */
size_t sdm_pod_place_weights(sdm_pod_type type, const sdm_pod_levels *levels,
                             const sdm_pod_block *blocks, const pod_slab *slabs, size_t n_slabs,
                             const pod_leaf *leaves, const uint32_t *wide, size_t *at);

/* Floats of the mean map, leaf by leaf, each filled up to whole panels. */
size_t sdm_pod_mean_count(const sdm_pod_levels *levels, const sdm_pod_block *blocks);

/* m->products from all else. */
void sdm_pod_products_fill(pod_network *m);

enum { SDM_POD_GROUP = 6 }; /* rows that go through a slab together: those of the kernels */

/* at[l] = number of coefficients of the levels below l, after sdm_pod_number(); the last: of all.
 */
void sdm_pod_place_coefficients(const sdm_pod_levels *levels, const sdm_pod_block *blocks,
                                size_t at[SDM_POD_MAX_LEVELS + 1]);

/* Wide columns of the head; 0 when weights are not bytes. */
static inline size_t sdm_pod_head_wide(const pod_network *m)
{
    return m->wide ? m->wide[m->arch.levels.first[m->arch.levels.n]] : 0;
}

/* As sdm_quantise(), and a zero behind each row: it is read beside an odd last input, times zero.
 */
void sdm_pod_quantise_rows(size_t rows, size_t n, const float *y, size_t ldy, const float *factor,
                           int limit, int16_t *x, size_t ldx, float *scale);

/* As sdm_quantise_residual(), and zeros behind both rows. */
void sdm_pod_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                               float *scale, int16_t *residual, float *residual_scale);

/* pod_latent.c: parameters to latent variables and back. Letters as in sdm/pod.h; D directions. */
typedef struct pod_latent {
    float *phi;   /* [R][n_poly] all products and their derivatives along the directions */
    float *h[2];  /* [R + 1][padded W] of a layer and of the one before; bytes: the last for the
                     residual  of the first */
    float *slope; /* [depth][padded W] */
    float *dphi;  /* [P][n_poly] derivatives with respect to each parameter */
    int16_t *integers; /* bytes: [R + 1][ld] inputs of a layer */
    float *scale;      /* bytes: [R + 1] theirs */
    size_t ld;
} pod_latent;

/* Sets the pointers into memory[] (NULL: none) for R rows of z; returns the floats needed. */
size_t sdm_pod_latent_carve(const pod_network *m, size_t rows, float *memory, pod_latent *w);

/* z[n][L]: latent variables at p[n][P]; of a single point their derivatives along direction[D][P]
 * too, z[1 + D][L]. */
void sdm_pod_latent(const sdm_model *model, const double *p, size_t n, size_t n_directions,
                    const double *direction, const pod_latent *w, float *z);

/* gradient[P] = (dz / dp)^T dz[L], at the parameters p of the last sdm_pod_latent() with this w. */
void sdm_pod_latent_back(const sdm_model *model, const double *p, const pod_latent *w,
                         const float *dz, double *gradient);

/* pod_decode.c: latent variables to maps and back. R rows of z go together: maps, or a map and its
 * derivatives. */
typedef struct pod_scratch {
    float *z; /* [R][L] */
    float *c; /* [R][padded K] coefficients of the highest level; or the same as integers, rows as
                 far apart */
    float *sorted;       /* bytes: a row of z, or the inputs of a block, in the order of columns */
    int16_t *z_integers; /* bytes: [R][ldz] */
    float *z_scale;      /* bytes: [R] */
    size_t ldz;
    float *threads; /* memory of each thread */
    size_t per_thread;
} pod_scratch;

/* Sets the pointers into memory[] (NULL: none); returns the floats needed. */
size_t sdm_pod_scratch_carve(const pod_network *m, size_t rows, int n_threads, float *memory,
                             pod_scratch *w);

/* maps[R] from w->z; the mean map is added to the first `with_mean`. smooth: bytes do not round the
   inputs of the first, so that it changes smoothly with the parameters, and inputs of any size are
   as fine; else their units are fixed, for maps within the ranges of the parameters. stream: as
   sdm_copy(). */
void sdm_pod_decode(const pod_network *m, const sdm_grid *grid, size_t rows, size_t with_mean,
                    bool smooth, bool stream, float *const *maps, const pod_scratch *w,
                    int n_threads);

/* pod_decode_back.c: dz[L] = the transpose times adjoint[voxels]. One thread. */
void sdm_pod_decode_back(const pod_network *m, const sdm_grid *grid, const float *adjoint,
                         const pod_scratch *w, float *dz);

/* pod_forward.c */
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
