/* Samples: the voxels or points that a fit uses, and the field of the shape there. */
#pragma once

#include "map_fields.h"
#include "observation.h"

/* A sum over samples is computed in this number of slices, and the sums of the slices are added in
 * order: so its bits do not depend on the number of threads. */
#define FIT_SLICES 64u

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
} fit_samples;

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

/* Sets the members field, row and jacobian of *samples for every sample from maps->packed or,
 * direct, from the surface; either must have been made with derivatives. */
sdm_status sdm_fit_samples_evaluate(fit_samples *samples, const fit_maps *maps,
                                    const fit_observation *obs, const fit_state *state,
                                    sdm_error *err);

/* Transform a point (mm) from the world to the shape's frame, y = R^T (x - t), and back, x = R y +
 * t. */
void sdm_fit_to_shape(const fit_state *s, const double x[3], double y[3]);
void sdm_fit_to_world(const fit_state *s, const double y[3], double x[3]);
