/* The parts of a phantom: filters, random fields, air cells, tissue shares. */
#pragma once

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

/* SDM_E_CANCELLED if o->cancelled() returns true. [any thread] */
static inline sdm_status phantom_check_cancelled(const sdm_phantom_opts *o, sdm_error *err)
{
    if (!o->cancelled || !o->cancelled(o->user)) return SDM_OK;
    return sdm_fail(err, SDM_E_CANCELLED, "phantom stopped on request");
}

/* ---- phantom_filter.c: filters along one axis ---- */

/* out[k] = sum over j of weight[j] * in[k * step + j], with n weights. */
typedef struct phantom_filter {
    float *weight;
    size_t n, step;
} phantom_filter;

/* A filter that averages over boxes of `step` samples and smooths by a Gaussian of `sigma` samples
   (0: no smoothing). The weights add up to 1; n = step + 2 radius, where the Gaussian has 2 radius
   + 1 weights. For 0 < sigma < 0.5 these are three weights with the exact variance. */
sdm_status phantom_filter_make(double sigma, size_t step, phantom_filter *out, sdm_error *err);
void phantom_filter_dispose(phantom_filter *f);

/* Number of input samples needed for n results: n * step + 2 radius. */
size_t phantom_filter_samples(const phantom_filter *f, size_t n);

/* Filters a line of floats in place; the n results lie at its beginning. [any thread] */
void phantom_filter_line(const phantom_filter *f, float *data, size_t n);

/* The same for rows as samples: each has `inner` floats, and rows are `stride` floats apart. [any
   thread] */
void phantom_filter_rows(const phantom_filter *f, float *data, size_t n, size_t stride,
                         size_t inner);

/* ---- phantom_field.c: random fields ---- */

/* *out = new field [nz][ny][nx] of mean 0 and variance 1: white noise smoothed by a Gaussian of
   sigma[3] mm. Free with sdm_free(); NULL after an error. */
sdm_status phantom_field_make(const sdm_grid *grid, const double sigma[3],
                              const sdm_phantom_opts *o, uint64_t stream, float **out,
                              sdm_error *err);

/* ---- phantom_air.c: air cells ---- */

/* Air cells: balls of one radius. */
typedef struct phantom_balls {
    double (*centre)[3]; /* [n] in the world, mm */
    size_t n;
    double radius;
} phantom_balls;

/* *out = at least all balls that intersect the box min .. max (world, mm). SDM_E_ARG: more than 1e8
   lattice cubes. */
sdm_status phantom_balls_make(const sdm_phantom_opts *o, const double min[3], const double max[3],
                              phantom_balls *out, sdm_error *err);
void phantom_balls_dispose(phantom_balls *b);

/* distance[ny][nx] = signed distance to the nearest ball on plane k of the grid, mm, where it is
   below `reach`; elsewhere `reach`. [any thread] */
void phantom_balls_plane(const phantom_balls *b, const sdm_grid *grid, size_t k, double reach,
                         float *distance);

/* ---- phantom_shares.c: shares of the tissues ---- */

/* inside[nz][ny][nx] = share of the inside in each voxel, convolved with the point spread;
   air[nz][ny][nx] (may be NULL) = the same for the air cells. */
sdm_status phantom_shares(const sdm_exact *engine, const sdm_pose *pose, const sdm_phantom_opts *o,
                          const sdm_grid *grid, float *inside, float *air, sdm_error *err);

/* The grid in coordinates of the shape: its origin and axes after the inverse of `pose`. */
sdm_grid phantom_shape_grid(const sdm_grid *grid, const sdm_pose *pose);
