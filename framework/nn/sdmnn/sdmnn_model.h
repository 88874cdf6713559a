/* The opened sdmnn model. Sections of the file:
     sdmnn.dense   float: w1[W][P], b1[W], b2[cells], then the biases of every convolution
     sdmnn.volume  panels of w2, float or half
     sdmnn.conv    w[outputs][inputs][taps] of every convolution, float or half */
#ifndef SDM_SDMNN_MODEL_H
#define SDM_SDMNN_MODEL_H

#include "model/model_kind.h"
#include "passes.h"

typedef struct sdmnn_model {
    sdmnn_plan plan; /* of the forward pass */
    sdmnn_plan kept; /* of the Jacobian */
    sdmnn_layers layers;
    float *packed; /* memory of layers.packed */
    bool half;
    const float *w1, *b1, *b2;
    const void *volume; /* panels */
    const void *conv;
} sdmnn_model;

/* Floats of the section sdmnn.dense. */
size_t sdm_sdmnn_dense_floats(const sdmnn_plan *p);
/* Weights of the section sdmnn.conv. */
size_t sdm_sdmnn_conv_count(const sdmnn_plan *p);

/* The convolutions in the order of this machine's kernels, for the forward or the backward pass, to
   `to`, whose places come into packed[SDMNN_STEPS]. layer: room for the largest as float. */
size_t sdm_sdmnn_packed_floats(const sdmnn_plan *p, bool transposed);
size_t sdm_sdmnn_largest_layer(const sdmnn_plan *p);
void sdm_sdmnn_pack_layers(const sdmnn_model *k, bool transposed, float *layer, float *to,
                           const float **packed);

/* Entries of the kind's table (model_kind.h). */
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

#endif
