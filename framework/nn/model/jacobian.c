/* Products of a given Jacobian with a direction, and of the transposed Jacobian with an adjoint
   map. */
#include <string.h>

#include "sdm/model.h"

void sdm_jacobian_times(const float *jacobian, size_t n_params, size_t n, const double *direction,
                        float *tangent)
{
    memset(tangent, 0, n * sizeof *tangent);
    for (size_t i = 0; i < n_params; i++)
        for (size_t v = 0; v < n; v++) tangent[v] += (float)direction[i] * jacobian[i * n + v];
}

void sdm_jacobian_transposed_times(const float *jacobian, size_t n_params, size_t n,
                                   const float *adjoint, double *gradient)
{
    for (size_t i = 0; i < n_params; i++) {
        gradient[i] = 0;
        for (size_t v = 0; v < n; v++) gradient[i] += (double)adjoint[v] * jacobian[i * n + v];
    }
}
