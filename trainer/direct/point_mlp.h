/* The perceptron of a point network (sdm/internal/point_network.h) on batches of points: forward
   and backward pass. B is the number of points; that header defines the other letters and the order
   of the weights. Results do not depend on n_threads, the number of threads of the caller's team
   (sdm/internal/team.h). */
#pragma once

#include "sdm/internal/point_network.h"

/* Random initial weights: normal with variance 2 / K_l (He et al. 2015) for K_l inputs, in the last
 * layer 0.1 / H for H inputs; biases 0; counter-based random numbers. */
void trainer_point_init(const sdm_point_arch *a, uint64_t seed, float *w);

/* Floats of workspace for a batch. */
size_t trainer_point_workspace(const sdm_point_arch *a, size_t batch);

/* value[B] = outputs (mm) at the inputs u[B][U]. */
void trainer_point_forward(const sdm_point_arch *a, const float *w, size_t batch, const float *u,
                           float *workspace, float *value, int n_threads);

/* Adds to gradient[sdm_point_count()] the derivative of the loss by the weights, from slope[B], the
   derivative of the loss by each value. Call after trainer_point_forward() with the same arguments.
 */
void trainer_point_backward(const sdm_point_arch *a, const float *w, size_t batch, const float *u,
                            float *workspace, const float *slope, float *gradient, int n_threads);
