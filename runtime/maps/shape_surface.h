/* The surface of a shape at one set of parameters, ready for exact maps and distances. */
#pragma once

#include "sdm/runtime.h"

/* Zero-initialise. */
typedef struct shape_surface {
    sdm_exact *engine;
    sdm_mesh mesh;
    size_t n_params;
    /* [n_params][mesh.n_vert][3] derivatives of the vertices by the parameters; NULL: not made */
    double *velocity;
} shape_surface;

/* Replaces *surface by that of the shape at params[n_params]. On error it is empty. */
sdm_status sdm_shape_surface_make(const sdm_instance *shape, const double *params, bool derivatives,
                                  const sdm_exact_opts *opts, shape_surface *surface,
                                  sdm_error *err);
void sdm_shape_surface_dispose(shape_surface *surface);

/* by[n_params] = derivatives, by the parameters, of the signed distance at a point whose nearest
   point closest[3] lies on triangle `triangle` of sdm_exact_surface(), and at which the gradient of
   the distance is gradient[3]: -gradient . velocity. Needs velocities. */
void sdm_shape_surface_derivatives(const shape_surface *surface, uint32_t triangle,
                                   const double closest[3], const double gradient[3], double *by);

/* *area (mm^2) of the surface, parts inside a union left out, and its derivatives
   gradient[n_params]; the lines where parts cross count as fixed on their triangles. Needs
   velocities. */
void sdm_shape_surface_area(const shape_surface *surface, double *area, double *gradient);
