/* The opened point network. */
#ifndef SDM_POINT_INTERNAL_H
#define SDM_POINT_INTERNAL_H

#include "model/model_kind.h"
#include "sdm/internal/point_network.h"

/* Section "point.hidden": for each layer l > 0 the matrix [W_l][W_(l-1)] in tiles, float or half.
   Section "point.input", float: for each layer bias[W_l], then, where the input enters, [U][W_l];
   then w[H], b. */
typedef struct point_network {
    sdm_point_arch arch;
    bool half;
    const void *hidden; /* all matrices */
    size_t hidden_at[SDM_POINT_MAX_DEPTH];
    const float *bias[SDM_POINT_MAX_DEPTH];
    const float *input[SDM_POINT_MAX_DEPTH]; /* [U][W_l]; NULL: the input does not enter */
    const float *last;                       /* w[H], b */
    size_t max_width, rows; /* rows: of points that go through the layers together */
} point_network;

/* Elements of the two sections; at[depth] (may be NULL): first of each layer. */
size_t sdm_point_hidden_count(const sdm_point_arch *a, size_t *at);
size_t sdm_point_input_count(const sdm_point_arch *a, size_t *at);

/* point_forward.c */
size_t sdm_point_scratch_bytes(const sdm_model *m, size_t n, int n_threads);
void sdm_point_forward(const sdm_model *m, const double *params, size_t n, float *values,
                       void *scratch, int n_threads);
size_t sdm_point_jacobian_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_point_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian,
                        void *scratch, int n_threads);

#endif
