/* The opened sdmnn model and the functions between the files of this folder. Letters as in
   sdm/internal/sdmnn.h.

   Sections of the model file (w1, b1, w2, b2: the two dense layers)
     sdmnn.dense   floats: w1[W][P], b1[W], b2[cells], then the biases of every convolution
     sdmnn.volume  w2[cells][W] in panels (sdm/internal/kernels.h) of floats or halves
     sdmnn.conv    w[outputs][inputs][taps] of every convolution, floats or halves */
#pragma once

#include "model/model_kind.h"
#include "passes.h"

typedef struct sdmnn_model {
    sdmnn_plan plan;     /* plan for maps only: feature maps share memory */
    sdmnn_plan kept;     /* plan for derivatives: all feature maps are kept */
    sdmnn_layers layers; /* without `transposed` */
    float *packed;       /* memory of layers.packed */
    bool half;           /* sections sdmnn.volume and sdmnn.conv are halves */
    const float *w1, *b1, *b2;
    const void *volume, *conv; /* the sections */
} sdmnn_model;

/* sdmnn_weights.c: number of floats in the section sdmnn.dense, and number of weights in the
   section sdmnn.conv. */
size_t sdm_sdmnn_dense_floats(const sdmnn_plan *p);

size_t sdm_sdmnn_conv_count(const sdmnn_plan *p);

/* sdmnn_weights.c: sdm_sdmnn_pack_layers() packs the weights of all convolutions for the forward or
   (transposed) the backward pass into to[sdm_sdmnn_packed_floats()], and sets packed[SDMNN_STEPS]
   to the start of the packed weights of each convolution. layer[sdm_sdmnn_largest_layer()]: buffer
   for the weights of one convolution as floats. */
size_t sdm_sdmnn_packed_floats(const sdmnn_plan *p, bool transposed);
size_t sdm_sdmnn_largest_layer(const sdmnn_plan *p);
void sdm_sdmnn_pack_layers(const sdmnn_model *k, bool transposed, float *layer, float *to,
                           const float **packed);

/* sdmnn_run.c: entries of the function table sdm_model_kind. */
size_t sdm_sdmnn_scratch_bytes(const sdm_model *m, size_t n, int n_threads);
void sdm_sdmnn_model_forward(const sdm_model *m, const double *params, size_t n, float *values,
                             void *scratch, int n_threads);
size_t sdm_sdmnn_jacobian_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_sdmnn_model_jacobian(const sdm_model *m, const double *params, float *values,
                              float *jacobian, void *scratch, int n_threads);
size_t sdm_sdmnn_jvp_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_sdmnn_model_jvp(const sdm_model *m, const double *params, const double *direction,
                         float *values, float *tangent, void *scratch, int n_threads);
size_t sdm_sdmnn_vjp_scratch_bytes(const sdm_model *m);
void sdm_sdmnn_model_vjp(const sdm_model *m, const double *params, const float *adjoint,
                         double *gradient, void *scratch);

/* sdmnn_onnx.c: entry of the function table. */
sdm_onnx_value sdm_sdmnn_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x);
