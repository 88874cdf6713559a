/* A model as a function of space: its map at any point, on any grid, and as a narrow band.
   sdm_generate_points(), sdm_generate_grid() and sdm_generate_band() are for one use of a map. For
   several uses, an sdm_field computes the map once.

   A network computes a map on the grid of its training. Between the voxel centres the map is
   continued by the cubic B-spline through them (Unser, Aldroubi and Eden 1991), which has
   continuous second derivatives; at the ends of an axis its third difference is zero. The index of
   a point in the model's grid is rounded to multiples of 2^-24. A point whose index is within 2^-25
   of that of a voxel centre has the value of the map, bit for bit.

   A model may have a fine level (sdm_model_info.fine_width, docs/grids.md). "The map" below is then
   one of half the spacing: halfway between the voxels it is the polynomial through the six nearest
   ones, which a small network corrects at creases of the distance. The voxels of the model's own
   grid keep their bits.

   The model knows the distance in its box: the box of the voxel centres of its grid. For a point x
   outside of it there is a lower bound (SDM_OUTSIDE_BOUND). Let y be the nearest point of the box,
   r = |x - y|, and d the distance in the box. Every point s of the box fulfils
   |x - s|^2 >= r^2 + |y - s|^2, since the box is convex. So the distance of x to the part of the
   solid in the box is at least sqrt(r^2 + max(d(y), 0)^2). The bound is continuous where the solid
   does not leave the box, and grows by at most 1 mm per mm if d does.

   Values have the same bits for any number of threads and on every instruction set. A point has the
   same bits as the voxel of a grid with its centre there in two cases: the axes of the grid are
   those of the model's grid, in the same order, and their directions hold only 0, 1 and -1; or no
   axis of the grid is parallel to one of the model's, and sdm_grid_world() gives the centre. On
   other grids values differ by rounding. */
#ifndef SDM_FIELD_H
#define SDM_FIELD_H

#include "sdm/blocks.h"
#include "sdm/runtime.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The map at one parameter vector, which sdm_field_set_params() changes. */
typedef struct sdm_field sdm_field;

/* *out = a field of the model, without a map yet; free it with sdm_field_free(), before the model.
   derivatives: slopes are wanted, too. Of opts (may be NULL) it uses policy, exact_shape, n_threads
   and outside; SDM_E_ARG if `check` or `max_error_mm` is set. [any thread] */
SDM_API sdm_status sdm_field_create(const sdm_model *m, const sdm_generate_opts *opts,
                                    bool derivatives, sdm_field **out, sdm_error *err);

/* Frees a field, which no thread may use any more; f may be NULL. */
SDM_API void sdm_field_free(sdm_field *f);

/* Computes the map at params[n_params], and with `derivatives` the Jacobian, by
   sdm_generate_jacobian(). result may be NULL. Under SDM_RANGE_EXACT, with parameters out of range,
   the functions below give exact distances. After an error the field has no map. Errors as
   sdm_generate() and sdm_exact_create(). [one thread, while no other one uses the field] */
SDM_API sdm_status sdm_field_set_params(sdm_field *f, const double *params, sdm_result *result,
                                        sdm_error *err);

/* The functions below may be called by any number of threads at the same time, after
   sdm_field_set_params(). Distances are in mm, negative inside; gradients are the derivatives by
   the world coordinates, mm per mm; slopes are the derivatives by the parameters, mm per unit of
   the parameter (sdm_model_check_use(SDM_USE_DERIVATIVE) tells how right they are). Outside of the
   box the option `outside` decides: gradients and slopes are then those of the bound or of the
   exact distance (sdm_exact_map_derivative()). SDM_E_RANGE: a point lies outside of the box and the
   option is SDM_OUTSIDE_REFUSE. SDM_E_ARG: a coordinate is not finite; slopes without
   `derivatives`. SDM_E_UNSUPPORTED: slopes of exact distances outside of the box, on a grid, or at
   points if the vertices of the shape have no derivatives (sdm_instance_velocity()). */

/* *value = the distance at x (LPS, mm); gradient[3] and slopes[n_params] may be NULL. Allocates
   nothing. */
SDM_API sdm_status sdm_field_point(const sdm_field *f, const double x[3], float *value,
                                   float gradient[3], float *slopes, sdm_error *err);

/* The same at the points x[n][3] on all threads: values[n]; gradient[n][3] and slopes[n][n_params]
   may be NULL. The message of an error names the first wrong point, counted from 1. */
SDM_API sdm_status sdm_field_points(const sdm_field *f, const double *x, size_t n, float *values,
                                    float *gradient, float *slopes, sdm_error *err);

/* values[nz][ny][nx] = the distances at the voxel centres of a grid; slopes[n_params][nz][ny][nx]
   may be NULL. Grids whose axes are parallel to those of the model's grid take about 1 ns a voxel,
   turned grids 14 to 20 ns. On the model's own grid the values have the bits of
   sdm_generate(). */
SDM_API sdm_status sdm_field_grid(const sdm_field *f, const sdm_grid *grid, float *values,
                                  float *slopes, sdm_error *err);

/* *out = the band of half width `width` (mm, at least the longest edge of a voxel) on a grid; free
   it with sdm_blocks_dispose(). Only blocks that can meet the band are evaluated. Values within the
   band are those of sdm_field_grid(). Voxels outside of the box count only if their bound lies
   within the band. With exact distances it is the band of sdm_exact_map_blocks(). On error *out is
   empty. */
SDM_API sdm_status sdm_field_band(const sdm_field *f, const sdm_grid *grid, double width,
                                  sdm_blocks *out, sdm_error *err);

/* The same for one parameter vector params[n_params], without a field. opts and result may be NULL;
   gradient and slopes, too. Errors as above.

   sdm_generate_grid() follows the options `check` and `max_error_mm`, as sdm_generate() does, on
   the given grid. `error_mm` of the result is that of the network on its own grid.

   Between two walls and beside edges the distance has ridges. There the network and the
   interpolation between voxels err most, by up to a part of a voxel, and the gradient is shorter
   than 1: below 0.7 take neither for exact. sdm_model_check_use(SDM_USE_DISTANCE) judges distances
   far from the surface. [any thread] */
SDM_API sdm_status sdm_generate_grid(const sdm_model *m, const double *params,
                                     const sdm_generate_opts *opts, const sdm_grid *grid,
                                     float *values, float *slopes, sdm_result *result,
                                     sdm_error *err);
SDM_API sdm_status sdm_generate_points(const sdm_model *m, const double *params,
                                       const sdm_generate_opts *opts, const double *x, size_t n,
                                       float *values, float *gradient, float *slopes,
                                       sdm_result *result, sdm_error *err);
SDM_API sdm_status sdm_generate_band(const sdm_model *m, const double *params,
                                     const sdm_generate_opts *opts, const sdm_grid *grid,
                                     double width, sdm_blocks *out, sdm_result *result,
                                     sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
