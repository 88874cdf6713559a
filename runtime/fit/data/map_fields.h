/* Maps of the shape in its own frame, and the fields made from them: the signed distance or the
 * share, with their derivatives. */
#pragma once

#include <math.h>

#include "interpolate.h"
#include "maps/shape_surface.h"
#include "unknowns.h"

typedef struct fit_maps {
    const sdm_fit_source *source;
    /* grid of the maps, in the shape's frame */
    sdm_grid grid;
    size_t n_voxels, n_params;
    /* number of fields in `packed`; 1 without derivatives */
    size_t n_fields;
    /* true: the field is the share; false: the signed distance */
    bool share;
    /* true: always use the exact engine; false: the network, where the policy allows it */
    bool exact;
    /* true: the samples are points, see fit_maps_direct() */
    bool points;
    /* mm: narrowest point spread that the spacing of the grid can represent, half a voxel */
    double min_blur;
    /* as in sdm_fit_opts */
    int n_threads;
    bool (*cancelled)(void *user);
    void *user;
    /* [n_params] parameters of the latest map */
    double params[FIT_PARAMS_MAX];
    /* latest map (mm) [n_voxels], and its derivatives by the parameters [n_params][n_voxels] */
    float *values, *jacobian;
    /* [n_voxels] the latest map in double precision, mm */
    double *distance;
    /* direct: the surface of the shape, and whether the arrays above hold its map */
    shape_surface surface;
    bool has_voxels;
    /* [n_voxels][n_fields] the field, its derivatives by the parameters and (share) by the blur, as
     * fit_field.packed; `spare` is scratch memory of the same size */
    double *packed, *spare;
    /* number of maps made so far: by the network; by the exact engine; by the exact engine because
     * parameters lay outside the network's range */
    size_t n_network, n_exact, n_outside;
    /* wall-clock time spent on these maps, s */
    double seconds_network, seconds_exact;
    /* whether the exact engine made the latest map */
    bool made_exact;
    /* NULL, or maps of the same shape on the grid moved by half a voxel along each axis, see
       solver/between.h. The field is then the mean of both */
    struct fit_maps *between;
} fit_maps;

/* Longest edge of a voxel, mm. */
static inline double fit_longest_edge(const sdm_grid *g)
{
    return fmax(g->spacing[0], fmax(g->spacing[1], g->spacing[2]));
}

/* Whether the distances of samples are those from the surface itself, without voxels: of points,
 * with the exact engine. */
static inline bool fit_maps_direct(const fit_maps *m) { return m->points && m->exact; }

/* Allocates memory for maps on the grid of the source; on error *out is empty. */
sdm_status sdm_fit_maps_create(const sdm_fit_source *source, bool share, const sdm_fit_opts *opts,
                               fit_maps *out, sdm_error *err);
void sdm_fit_maps_dispose(fit_maps *m);

/* Allocates m->between. _end: frees it, as sdm_fit_maps_dispose() does. */
sdm_status sdm_fit_maps_between_begin(fit_maps *m, const sdm_fit_opts *opts, sdm_error *err);
void sdm_fit_maps_between_end(fit_maps *m);

/* Makes the maps of m->between as sdm_fit_maps_make() does, which calls it, for the
   params[n_params] of the latest maps of *m: by the exact engine if it made those; else by
   interpolation of the distances, which is right where they are smooth. */
sdm_status sdm_fit_maps_between_make(fit_maps *m, const double *params, bool derivatives,
                                     sdm_error *err);

/* Computes values, distance and, if `derivatives`, jacobian at params[n_params]; `packed` is not
 * updated. Direct: makes the surface only, see sdm_fit_maps_voxels(). Returns SDM_E_CANCELLED or an
 * error of the engines. */
sdm_status sdm_fit_maps_make(fit_maps *m, const double *params, bool derivatives, sdm_error *err);

/* Direct: makes the map of the latest surface, if it is not made yet; call it before reading
 * values, distance or jacobian. Otherwise does nothing. */
sdm_status sdm_fit_maps_voxels(fit_maps *m, sdm_error *err);

/* Fills `packed` from the latest map, convolved with a Gaussian of sd `blur` (mm); without
   `derivatives` only its first field. Shares: blur >= min_blur. Distances: blur >= 0. `derivatives`
   needs a map that was made with derivatives. Direct: does nothing. */
void sdm_fit_maps_pack(fit_maps *m, double blur, bool derivatives);

/* Views of `packed` and of `distance` for interpolation. */
fit_field sdm_fit_maps_field(const fit_maps *maps);
fit_field sdm_fit_maps_distances(const fit_maps *maps);

/* Where the shape lies on its map: centroid (mm); reach, the largest distance (mm) from the
 * centroid to a voxel inside; volume (mm^3). */
typedef struct fit_extent {
    double centre[3], reach, volume;
} fit_extent;

/* Computes the extent from the voxels of maps->distance that lie inside. SDM_E_QUALITY: there are
 * not two of them. */
sdm_status sdm_fit_extent(const fit_maps *maps, fit_extent *out, sdm_error *err);

/* Radius (mm) of the largest ball inside the shape, centred on a voxel of the map. */
double sdm_fit_inradius(const fit_maps *maps);
