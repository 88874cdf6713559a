/* The voxels or points that are looked at, and the field of the shape there. */
#ifndef FIT_SITES_H
#define FIT_SITES_H

#include "interpolate.h"
#include "map_fields.h"
#include "observation.h"

/* Fixed number of parts in which sites are worked through: sums do not depend on the number of
 * threads. */
#define FIT_SLICES 64u

typedef struct fit_sites {
    size_t n, capacity, n_nan;
    double *world; // [n][3] mm
    float *value;  // [n]
    size_t *voxel; // [n] place in the image
    double *field; // [n]
    float *place;  // [n][n_outside] log weights of the tissues outside, see sdm_fit_places_update()
    size_t n_outside, place_capacity; // n_outside 0: the same weights everywhere
    size_t *slot; // [n] place in columns, or SIZE_MAX: the field has no derivative that counts
    size_t n_near, near_capacity, n_columns;
    float *columns; // [n_near][n_columns]: derivatives of the field by parameters, rotation,
                    // translation, blur
} fit_sites;

/* Where the shape is on its map: middle, farthest inside voxel from there (mm), volume (mm^3). */
typedef struct fit_extent {
    double centre[3], reach, volume;
} fit_extent;

/* Of the distance that maps holds. SDM_E_QUALITY: nothing is inside. */
sdm_status sdm_fit_extent(const fit_maps *maps, fit_extent *out, sdm_error *err);

/* Radius of the largest ball in the shape whose centre is a voxel of the map, mm. */
double sdm_fit_inradius(const fit_maps *maps);

/* A region of the world. */
typedef struct fit_region {
    double centre[3], radius; // a ball
    const fit_maps *follow;   // not NULL: also where the distance of the shape is at most margin
    const fit_state *state;
    double margin;
    size_t most; // voxels wanted at most: beyond them the choice stops, with one more. 0: all
} fit_region;

/* Chooses the voxels of a region (every `stride`-th along each axis), or all points. *changed: they
   are not those that were there before. SDM_E_FORMAT: an infinite value. */
sdm_status sdm_fit_sites_choose(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                const fit_region *region, size_t stride, fit_sites *sites,
                                bool *changed, sdm_error *err);
void sdm_fit_sites_dispose(fit_sites *s);

/* Of site i, for sdm_fit_respond(). */
static inline const float *fit_place(const fit_sites *s, size_t i)
{
    return s->n_outside ? s->place + i * s->n_outside : NULL;
}

/* What sdm_fit_maps_pack() made. */
fit_field sdm_fit_field(const fit_maps *maps);

/* The first field at x of the world, with the shape at the pose of s. */
double sdm_fit_field_at(const fit_field *f, const fit_state *s, const double x[3]);

/* Field and columns at every site from the packed fields. */
sdm_status sdm_fit_sites_sample(fit_sites *s, const fit_maps *maps, const fit_laws *laws,
                                const fit_state *state, sdm_error *err);

/* y = R^T (x - t). */
void sdm_fit_to_shape(const fit_state *s, const double x[3], double y[3]);
/* x = R y + t. */
void sdm_fit_to_world(const fit_state *s, const double y[3], double x[3]);

#endif
