/* The opened point network and the functions between the files of this folder. Letters as in
   sdm/internal/point_network.h. */
#pragma once

#include "model/model_kind.h"
#include "sdm/internal/point_network.h"

/* The model file has two sections. "point.hidden" holds for each layer l > 0 the columns of the
   weights that multiply h_(l-1), a W_l x W_(l-1) matrix, in panels (sdm/internal/kernels.h) of
   floats or halves. "point.input" holds floats: for each layer bias[W_l] and, if u enters the
   layer, the columns [U][W_l] that multiply u; then w[H] and b. */
typedef struct point_network {
    sdm_point_arch arch;
    bool half;                             /* the panels are halves, else floats */
    const void *hidden;                    /* section "point.hidden" */
    size_t hidden_at[SDM_POINT_MAX_DEPTH]; /* element at which the panels of a layer begin */
    const float *bias[SDM_POINT_MAX_DEPTH];
    const float *input[SDM_POINT_MAX_DEPTH]; /* [U][W_l]; NULL: u does not enter layer l */
    const float *last;                       /* w[H], then b */
    size_t max_width;
    size_t rows; /* R, the number of points that pass through the layers together */
} point_network;

/* Return the number of elements of the section "point.hidden" or "point.input". Unless NULL,
   at[depth] = index of the first element of each layer. */
size_t sdm_point_hidden_count(const sdm_point_arch *a, size_t *at);
size_t sdm_point_input_count(const sdm_point_arch *a, size_t *at);

/* point_forward.c: entries of the function table sdm_model_kind. */
size_t sdm_point_scratch_bytes(const sdm_model *m, size_t n, int n_threads);
void sdm_point_forward(const sdm_model *m, const double *params, size_t n, float *values,
                       void *scratch, int n_threads);
size_t sdm_point_jacobian_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_point_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                        void *scratch, int n_threads);

/* point_forward.c: q[n][3] = scaled coordinates of n voxels, from the index `first` on. */
void sdm_point_coordinates(const sdm_grid *g, const sdm_point_arch *a, size_t first, size_t n,
                           float *q);

/* point_onnx.c: entry of the function table. */
sdm_onnx_value sdm_point_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x);
