/* The perceptron of a point network (sdm/internal/point_network.h) on batches of points: forward
   and backward pass. B is the number of points; that header defines the other letters and the order
   of the weights. Results do not depend on n_threads, the number of threads of the caller's team
   (sdm/internal/team.h). */
#pragma once

#include "sdm/internal/comm.h"
#include "sdm/internal/point_network.h"

/* Random initial weights: normal with variance 2 / K_l (He et al. 2015) for K_l inputs, in the last
 * layer 0.1 / H for H inputs; biases 0; counter-based random numbers. */
void trainer_point_init(const sdm_point_arch *a, uint64_t seed, float *w);

/* Floats of workspace for a batch. */
size_t trainer_point_workspace(const sdm_point_arch *a, size_t batch);

/* The arguments of a forward and a backward pass. */
typedef struct point_pass {
    const sdm_point_arch *arch;
    const float *w;
    size_t batch;
    const float *u;   /* [B][U] inputs */
    float *workspace; /* trainer_point_workspace() floats, the same for both passes */
    sdm_comm *comm;   /* the ranks that share the passes; NULL: one process */
    int n_threads;
} point_pass;

/* value[B] = outputs, mm. Each rank computes some points, and all get all values. */
sdm_status trainer_point_forward(const point_pass *p, float *value, sdm_error *err);

/* Adds to gradient[sdm_point_count()] the derivative of the loss by the weights, from slope[B], the
   derivative of the loss by each value. Call after trainer_point_forward() with the same
   arguments. Each rank has the derivatives by the outputs of the layers for some points, and adds
   the gradient by the weights of some units of each layer: so each sum is made by one rank, in the
   order in which one process makes it. trainer_point_gather() completes the gradient. */
sdm_status trainer_point_backward(const point_pass *p, const float *slope, float *gradient,
                                  sdm_error *err);

/* Gives all ranks the gradient by the weights of all units. */
sdm_status trainer_point_gather(const sdm_point_arch *a, sdm_comm *comm, float *gradient,
                                sdm_error *err);
