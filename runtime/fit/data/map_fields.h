/* Maps of the shape with their derivatives, as fields that are sampled: the signed distance, or the
 * share of the shape in a voxel. */
#ifndef FIT_MAPS_H
#define FIT_MAPS_H

#include "problem.h"

typedef struct fit_maps {
    const sdm_fit_source *source;
    sdm_grid grid;
    size_t n_voxels, n_params;
    size_t n_fields; // of packed
    bool share; // the field is the share of the shape seen through a point spread; else the signed
                // distance
    bool exact; // ask the exact engine whatever the parameters are
    double least_blur; // mm, what the spacing of the grid can carry
    int n_threads;
    bool (*cancelled)(void *user);
    void *user;
    float *values, *jacobian; // [n_voxels], [n_params][n_voxels]: as maps are made
    double *distance;         // [n_voxels]: values
    // [n_voxels][n_fields]: the field, its derivatives by the parameters and (share) by the blur;
    // see fit_field
    double *packed, *spare;
    size_t n_network, n_exact, n_outside;
    double seconds_network, seconds_exact;
} fit_maps;

/* Zero-initialise before. */
sdm_status sdm_fit_maps_create(const sdm_fit_source *source, bool share, const sdm_fit_opts *opts,
                               fit_maps *out, sdm_error *err);
void sdm_fit_maps_dispose(fit_maps *m);

/* Distance and, where `derivatives`, jacobian at params. */
sdm_status sdm_fit_maps_at(fit_maps *m, const double *params, bool derivatives, sdm_error *err);

/* The fields of what sdm_fit_maps_at() made, without `derivatives` the first alone, seen through a
   Gaussian of sd blur (mm): for shares at least least_blur, for distances 0 or more. */
void sdm_fit_maps_pack(fit_maps *m, double blur, bool derivatives);

#endif
