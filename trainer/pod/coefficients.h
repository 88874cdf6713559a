/* Projects maps of the data set on the local bases. Letters as in sdm/internal/pod.h. */
#pragma once

#include "pod_state.h"

/* rows[n][V] = voxels of block b of the lowest level, minus the mean map, of the maps in slots[n];
   holdout: of the held-out maps number slots[n]. */
void trainer_coefficients_block_rows(const pod_state *pod, const sdm_pod_block *b, bool holdout,
                                     const size_t *slots, size_t n, float *rows);

/* One block: to[n][ldt] = from[n][ldf] * transpose of basis[rank][outputs]; `from` holds the
 * block's outputs, `to` receives its coefficients. One thread. */
void trainer_coefficients_project_block(size_t n, size_t rank, size_t outputs, const float *basis,
                                        const float *from, size_t ldf, float *to, size_t ldt);

/* Projects maps through all levels: y[n][K] = coefficients of the highest level of n maps, those in
   the slots slots[n] of the pool or, if `holdout`, the held-out maps with the numbers slots[n]. */
sdm_status trainer_coefficients_project(const pod_state *pod, bool holdout, const size_t *slots,
                                        size_t n, float *y, sdm_error *err);
