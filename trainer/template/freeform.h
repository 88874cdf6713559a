/* Free-form deformations: cubic B-splines on a lattice that carry given displacements of points
   into space (Rueckert et al. 1999). */
#pragma once

#include "sdm/internal/template.h"

/* A lattice with the given distance between control points whose splines cover the box from min[3]
   to max[3]. */
sdm_lattice trainer_freeform_lattice(const double min[3], const double max[3], double spacing);

/* control[M][nodes][3] = for each of M fields the control displacements that minimise the sum over
   the n points of |U(x) - value|^2, plus a small multiple of the bending energy (second differences
   of the control points), which continues the field smoothly to places without points. x[n][3],
   values[M][n][3], mm. *error = largest over the fields of the root mean square residual, mm.
   Method: banded Cholesky factorisation of the normal equations. SDM_E_NOMEM, SDM_E_INTERNAL. */
sdm_status trainer_freeform_fit(const sdm_lattice *l, size_t n, const double *x, size_t n_fields,
                                const float *values, int n_threads, float *control, double *error,
                                sdm_error *err);
