/* Dense layer on a batch, and its gradients. */
#include <string.h>

#include "operators.h"
#include "sdm/internal/kernels.h"

void sdm_dense_forward(size_t batch, size_t in, size_t out, const float *w, const float *bias,
                       const float *x, float *y, int n_threads)
{
    for (size_t b = 0; b < batch && bias; b++) memcpy(y + b * out, bias, out * sizeof *y);
    sdm_gemm(batch, out, in, (sdm_view){x, in, 1}, (sdm_view){w, 1, in}, bias != NULL, y, out,
             n_threads);
}

void sdm_dense_backward(size_t batch, size_t in, size_t out, const float *w, const float *x,
                        const float *dy, float *dw, float *db, float *dx, int n_threads)
{
    sdm_gemm(out, in, batch, (sdm_view){dy, 1, out}, (sdm_view){x, in, 1}, true, dw, in, n_threads);
    for (size_t b = 0; b < batch; b++)
        for (size_t o = 0; o < out; o++) db[o] += dy[b * out + o];
    if (dx)
        sdm_gemm(batch, in, out, (sdm_view){dy, out, 1}, (sdm_view){w, in, 1}, false, dx, in,
                 n_threads);
}
