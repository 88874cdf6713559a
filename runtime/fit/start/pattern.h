/* A shape as points within it and around it: a matched filter that is scored in any pose. */
#pragma once

#include "likeness.h"

typedef struct fit_pattern {
    /* centroid of the shape, in its frame, and its reach from there, mm; radius of its largest
     * ball */
    double centre[3], reach, inradius;
    /* points relative to the centroid, in the shape's frame, mm: [n_inside] in the shape, then
     * [n - n_inside] in a layer around it */
    size_t n, n_inside;
    double (*points)[3];
} fit_pattern;

/* The pattern of the shape of a source at params (NULL: the defaults): voxels of its map, thinned
   evenly. The layer begins a quarter of the inradius from the surface, which leaves out narrow
   gaps, and is one inradius wide. SDM_E_QUALITY: no voxel of the map is inside; errors of making
   the map. */
sdm_status sdm_fit_pattern_make(const sdm_fit_source *source, const sdm_fit_opts *opts,
                                fit_pattern *out, sdm_error *err);
void sdm_fit_pattern_dispose(fit_pattern *p);

/* A pose of a pattern in an image: a rotation matrix from the frame of the shape to the axes of the
 * image; the place of the centroid, mm along these axes from the first voxel; and the size over
 * that of the pattern. */
typedef struct fit_place {
    double rotation[9], at[3], size;
} fit_place;

/* Mean likeness of the points in the shape less that of the points around it, -1 .. 1; of every
 * stride-th point, by trilinear interpolation. */
double sdm_fit_pattern_score(const fit_pattern *p, const fit_likeness *l, const sdm_grid *g,
                             const fit_place *place, size_t stride);

/* Moves *place to the nearest maximum of the score by steps along the axes, about them and of the
 * size (3/4 .. 4/3), which are halved until they are below a box of l; returns the score. */
double sdm_fit_pattern_climb(const fit_pattern *p, const fit_likeness *l, const sdm_grid *g,
                             size_t stride, fit_place *place);
