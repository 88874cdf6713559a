/* A network that shares the work of one map among threads. */
#ifndef SDM_INTERNAL_MODEL_THREADS_H
#define SDM_INTERNAL_MODEL_THREADS_H

#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The functions below share each map among n_threads >= 1 threads, with the same bits for any
   number. True: a map is work enough for that; otherwise several maps are better given to a thread
   each. */
bool sdm_model_is_threaded(const sdm_model *m);
size_t sdm_model_scratch_bytes_threads(const sdm_model *m, size_t n, int n_threads);
void sdm_model_forward_threads(const sdm_model *m, const double *params, size_t n, float *values,
                               void *scratch, int n_threads);
size_t sdm_model_jacobian_scratch_bytes_threads(const sdm_model *m, int n_threads);
void sdm_model_jacobian_threads(const sdm_model *m, const double *params, float *values,
                                float *jacobian, void *scratch, int n_threads);

#ifdef __cplusplus
}
#endif
#endif
