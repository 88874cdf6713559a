/* The perceptron of a point network (sdm/point_network.h) on batches of points, forwards and
   backwards. B points; other letters as there. Weights as in sdm_point_count(). */
#ifndef SDM_POINT_MLP_H
#define SDM_POINT_MLP_H

#include "sdm/internal/point_network.h"

/* Random start: normal with variance 2 / K_l (He et al. 2015), the last layer's a tenth of 1 / H,
 * biases zero; counter-based. */
void point_init(const sdm_point_arch *a, uint64_t seed, float *w);

/* Floats of workspace for a batch. */
size_t point_workspace(const sdm_point_arch *a, size_t batch);

/* u[B][U] -> value[B], mm. */
void point_forward(const sdm_point_arch *a, const float *w, size_t batch, const float *u,
                   float *workspace, float *value, int n_threads);

/* slope[B], the derivative of the loss by each value -> added to gradient[sdm_point_count()]. After
   point_forward() with the same arguments. The same bits for any number of threads. */
void point_backward(const sdm_point_arch *a, const float *w, size_t batch, const float *u,
                    float *workspace, const float *slope, float *gradient, int n_threads);

#endif
