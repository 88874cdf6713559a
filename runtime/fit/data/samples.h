/* Samples: the voxels or points that a fit uses, and the field of the shape there. */
#pragma once

#include "fit/open/open_space.h"
#include "map_fields.h"
#include "observation.h"

/* A sum over samples is computed in this number of slices, and the sums of the slices are added in
 * order: so its bits do not depend on the number of threads. */
#define FIT_SLICES 64u

/* How far samples lie beyond the open end of the shape. */
typedef struct fit_beyond {
    /* false: the fit has no open end, or the samples beyond it were removed */
    bool on;
    /* mm, see fit_open_end */
    double margin;
    /* [n] see sdm_fit_open_end_weight() */
    double *weight;
    /* [n] row of `jacobian`, or SIZE_MAX where the weight is 0 or 1 */
    size_t *row;
    size_t capacity, row_capacity; /* samples and rows for which there is memory */
    /* [rows][n_columns] derivatives of the weight, as fit_samples.jacobian */
    float *jacobian;
} fit_beyond;

/* The samples of a fit. Zero-initialise. */
typedef struct fit_samples {
    /* number of samples; number for which there is memory; voxels of the region that were skipped
     * because they are NaN */
    size_t n, capacity, n_nan;
    /* [n][3] position in the world, mm */
    double *world;
    /* [n] value of the image; 0 for points */
    float *value;
    /* [n] index of the voxel in the image, or of the point */
    size_t *voxel;
    /* [n] field of the shape at the sample */
    double *field;
    /* [n][n_outside] tissue field: log weights of the outside tissues at the sample; n_outside = 0:
     * the weights are the same everywhere */
    float *log_weight;
    size_t n_outside, log_weight_capacity;
    /* [n] row of `jacobian`, or SIZE_MAX outside the band */
    size_t *row;
    /* number of rows in use (one for each sample of the band); rows for which there is memory;
     * columns */
    size_t n_band, band_capacity, n_columns;
    /* [n_band][n_columns] derivatives of the field by parameters, rotation, translation, blur */
    float *jacobian;
    /* fits with an open end: how far the samples lie beyond it */
    fit_beyond beyond;
} fit_samples;

/* Transform a point (mm) from the world to the shape's frame, y = R^T (x - t), and back, x = R y +
 * t. */
void sdm_fit_to_shape(const fit_state *s, const double x[3], double y[3]);
void sdm_fit_to_world(const fit_state *s, const double y[3], double x[3]);

/* Region of the world to take samples from: a ball, intersected with the box of the options. */
typedef struct fit_region {
    /* mm */
    double centre[3], radius;
    /* not NULL: only where the signed distance of these maps, at the pose of state, is at most
     * margin (mm) */
    const fit_maps *follow;
    const fit_state *state;
    double margin;
    /* > 0: stop when the number of samples exceeds this; 0: no limit */
    size_t max_samples;
} fit_region;

/* Chooses as samples the voxels of a region, every stride-th along each axis, or every
   stride-th point of a point target. *changed: the samples differ from the earlier ones; the tissue
   field is then removed. SDM_E_FORMAT: a value is infinite. */
sdm_status sdm_fit_samples_choose(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                  const fit_region *region, size_t stride, fit_samples *samples,
                                  bool *changed, sdm_error *err);
void sdm_fit_samples_dispose(fit_samples *s);

/* Log weights of the outside tissues at sample i for sdm_fit_likelihood(); NULL: no tissue field.
 */
static inline const float *fit_sample_weights(const fit_samples *s, size_t i)
{
    return s->n_outside ? s->log_weight + i * s->n_outside : NULL;
}

/* First field at x of the world (mm), with the shape at the pose of s. */
double sdm_fit_field_at(const fit_field *f, const fit_state *s, const double x[3]);

/* The same of the latest maps: of maps->packed or, direct, of the surface. */
double sdm_fit_maps_at(const fit_maps *maps, const fit_state *s, const double x[3]);

/* One row of the Jacobian: columns[] = derivatives of a field at x of the world, whose gradient in
 * the shape's frame is gradient[3], and whose derivatives by the parameters and (share) by the blur
 * are rest[]. */
void sdm_fit_jacobian_row(const fit_maps *maps, const fit_state *state, const double x[3],
                          const double gradient[3], const double *rest, float *columns);

/* ---- beyond.c: samples beyond an open end ---- */

/* Sets the weights beyond the open end at state->params, and their derivatives. Does nothing where
 * beyond.on is false. Errors of sdm_instance_open_end(). */
sdm_status sdm_fit_beyond_evaluate(fit_samples *s, const fit_maps *maps, const fit_state *state,
                                   sdm_error *err);

/* The weight of sample i as the latest sdm_fit_beyond_evaluate() found it; 0: no open end. */
static inline double fit_sample_beyond(const fit_samples *s, size_t i)
{
    return s->beyond.on ? s->beyond.weight[i] : 0;
}

/* Whether a sample lies beyond the open end: it tells nothing about tissues and noise. */
static inline bool fit_sample_is_beyond(const fit_samples *s, size_t i)
{
    return s->beyond.on && s->beyond.weight[i] > 0.5;
}

/* *end = the open end with the parameters of the latest maps; false: the samples have none. */
bool sdm_fit_beyond_end(const fit_samples *s, const fit_maps *maps, fit_open_end *end);

/* The weight beyond it of x of the world. */
static inline double sdm_fit_beyond_at(const fit_open_end *end, const fit_state *s,
                                       const double x[3])
{
    double y[3];
    sdm_fit_to_shape(s, x, y);
    return sdm_fit_open_end_weight(end, y, NULL, NULL);
}

/* Likelihood of one sample, as sdm_fit_likelihood(), of this weight beyond the open end. There the
   sample is outside, or half as probably inside, whatever the field is; this is mixed with the
   likelihood by the field. So the shape gains nothing by covering what lies beyond. A sample with
   the values of the outside counts the same on either side of the end, so that its place does not
   depend on how many samples lie beyond; one with the values of the inside counts log(2) more
   within the shape, which keeps the end from moving back. Sets residual and root for a weight of 0
   only. Returns the derivative of the log-likelihood by the weight. */
double sdm_fit_likelihood_beyond(const fit_observation *obs, double value, const float *log_weight,
                                 double field, double weight, bool derivatives,
                                 fit_likelihood *out);

/* Removes the samples beyond the open end, as fit_sample_is_beyond(), and takes the others as if
 * there were no open end, until samples are chosen again. Returns how many were removed; evaluate
 * the others anew. */
size_t sdm_fit_samples_drop_beyond(fit_samples *s);

/* Sets the members field, row and jacobian of *samples for every sample from maps->packed
 * or, direct, from the surface; either must have been made with derivatives. */
sdm_status sdm_fit_samples_evaluate(fit_samples *samples, const fit_maps *maps,
                                    const fit_observation *obs, const fit_state *state,
                                    sdm_error *err);
