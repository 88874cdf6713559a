/* Maps of the data set as coefficients of the local bases. Letters as in sdm/pod.h. */
#ifndef SDM_COEFFICIENTS_H
#define SDM_COEFFICIENTS_H

#include "trainer.h"

/* rows[n][V] of block b of the lowest level for the maps in slots[n], or for held-out maps of those
 * numbers, without the mean. */
void coefficients_rows(const trainer *t, const sdm_pod_block *b, bool holdout, const size_t *slots,
                       size_t n, float *rows);

/* to[n][ldt] = coefficients of a block with basis[rank][outputs] from its outputs from[n][ldf]. */
void coefficients_project(size_t n, size_t rank, size_t outputs, const float *basis,
                          const float *from, size_t ldf, float *to, size_t ldt);

/* y[n][K]: coefficients of the highest level of the maps in slots[n], or of held-out maps of those
 * numbers. */
sdm_status coefficients_of(const trainer *t, bool holdout, const size_t *slots, size_t n, float *y,
                           sdm_error *err);

#endif
