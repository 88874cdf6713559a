/* Random parameter vectors of shapes, spread evenly. */
#pragma once

#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

/* p[n] = random parameter vector number `index` of `stream`, within min[n] .. max[n]: the quantiles
   of distribution[n] at a Sobol' point (Joe and Kuo 2008) with a random digital shift for n <= 64,
   or at independent counter-based random numbers for n > 64. Depends on the arguments only. [any
   thread] */
void sdm_sample_params(uint64_t seed, uint64_t stream, uint64_t index, const double *min,
                       const double *max, const sdm_distribution *distribution, size_t n,
                       double *p);

#ifdef __cplusplus
}
#endif
