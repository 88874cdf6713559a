/* Evaluation of one model by several threads. */
#pragma once

#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* True: one map is enough work for several threads ("deepsdf", "imnet", "sdmnn"). False: it is
   faster to give each thread its own maps. [any thread] */
bool sdm_model_is_threaded(const sdm_model *m);

/* These functions do the same as those of sdm/model.h whose names lack _threads, but n_threads >= 1
   threads share the work. The result does not depend on n_threads. The size of the scratch memory
   must have been computed for the same n_threads. */
size_t sdm_model_scratch_bytes_threads(const sdm_model *m, size_t n, int n_threads);
void sdm_model_forward_threads(const sdm_model *m, const double *params, size_t n, float *values,
                               void *scratch, int n_threads);
size_t sdm_model_jacobian_scratch_bytes_threads(const sdm_model *m, int n_threads);
void sdm_model_jacobian_threads(const sdm_model *m, const double *params, float *values,
                                float *jacobian, void *scratch, int n_threads);

#ifdef __cplusplus
}
#endif
