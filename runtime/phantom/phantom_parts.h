/* What makes up a phantom: filters, random fields, air cells, the shares of the tissues. */
#ifndef SDM_PHANTOM_PARTS_H
#define SDM_PHANTOM_PARTS_H

#include "sdm/exact.h"
#include "sdm/phantom.h"

/* Streams of random numbers. */
enum {
    PHANTOM_STREAM_NOISE = 1,
    PHANTOM_STREAM_TEXTURE,
    PHANTOM_STREAM_AIR,
    PHANTOM_STREAM_PARAMS,
    PHANTOM_STREAM_POSE
};

/* SDM_E_CANCELLED when the options say so. [any thread] */
sdm_status phantom_check(const sdm_phantom_opts *o, sdm_error *err);

/* ---- filters along one axis ---- */

/* out[k] = sum over j of weight[j] in[k * step + j], with n weights. */
typedef struct phantom_filter {
    float *weight;
    size_t n, step;
} phantom_filter;

/* Sampled Gaussian of `sigma` samples (0: identity) over boxes of `step` samples, of sum 1; n =
   step + 2 radius. A narrow one has three weights and the exact variance. */
sdm_status phantom_filter_make(double sigma, size_t step, phantom_filter *out, sdm_error *err);
void phantom_filter_dispose(phantom_filter *f);

/* n + 2 radius, or n * step + 2 radius: samples needed for n results. */
size_t phantom_filter_samples(const phantom_filter *f, size_t n);

/* In place: n results of a line of floats; n results that are rows of `inner` floats, stride floats
 * apart. [any thread] */
void phantom_filter_line(const phantom_filter *f, float *data, size_t n);
void phantom_filter_rows(const phantom_filter *f, float *data, size_t n, size_t stride,
                         size_t inner);

/* ---- random fields ---- */

/* *out = new field [nz][ny][nx] of mean 0 and variance 1: white noise smoothed with a Gaussian of
 * sigma[3] mm; NULL after an error. */
sdm_status phantom_field_make(const sdm_grid *grid, const double sigma[3],
                              const sdm_phantom_opts *o, uint64_t stream, float **out,
                              sdm_error *err);

/* ---- air cells ---- */

typedef struct phantom_balls {
    double (*centre)[3]; /* [n], mm, world */
    size_t n;
    double radius;
} phantom_balls;

/* The balls that reach the box min..max (mm, world). */
sdm_status phantom_balls_make(const sdm_phantom_opts *o, const double min[3], const double max[3],
                              phantom_balls *out, sdm_error *err);
void phantom_balls_dispose(phantom_balls *b);

/* distance[ny][nx] = signed distance to the nearest ball on plane k of the grid; only what is below
   `reach` is right, the rest is not less. [any thread] */
void phantom_balls_plane(const phantom_balls *b, const sdm_grid *grid, size_t k, double reach,
                         float *distance);

/* ---- shares of the tissues ---- */

/* inside[nz][ny][nx] = share of the inside, seen through the point spread; air (NULL: none) that of
 * the air cells. */
sdm_status phantom_shares(const sdm_exact *engine, const sdm_pose *pose, const sdm_phantom_opts *o,
                          const sdm_grid *grid, float *inside, float *air, sdm_error *err);

/* The grid of the world as seen from the shape's frame. */
sdm_grid phantom_shape_grid(const sdm_grid *grid, const sdm_pose *pose);

#endif
