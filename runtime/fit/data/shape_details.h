/* How large a shape is inside, and which voxels show its details: measured at its exact surface, so
   that neither the errors of a network nor the voxels of a map count. */
#pragma once

#include "map_fields.h"

typedef struct fit_details {
    /* radius of the largest ball inside the shape, mm */
    double radius;
    /* thickness of the thinnest part, mm; NaN: not known */
    double thinnest;
    /* longest edge of voxels that show the details of the surface, mm; INFINITY: all up to `most`
     * do */
    double edge;
} fit_details;

/* Measures the shape of the source of the maps at params[]. Voxels have the proportions of those of
   the maps; they show a detail where the distance hardly bends from one voxel to the second next.
   `edge` is that of grids at any place; where an exact map on the grid of the maps shows the
   details by luck, it is longer than their voxels. most: edge of the longest voxels that are tried,
   mm, unless a quarter of the largest ball's diameter is shorter. The same bits for any number of
   threads. SDM_E_QUALITY: the surface has no area or no inside; errors of making the shape,
   SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_fit_shape_details(const fit_maps *maps, const double *params, double most,
                                 fit_details *out, sdm_error *err);

/* Index of the parameter whose change thickens the thinnest part most, if a change by a fiftieth of
   its range at least doubles its thickness `thinnest`, mm; the number of parameters: there is none.
 */
size_t sdm_fit_thinning_param(const sdm_instance *shape, const double *params, double thinnest);

/* The same figures as sdm_fit_shape_details(), as far as a map shows them, for the network of a
 * shape that is not known. Its errors count as details. thinnest: as the training measured it, mm;
 * NaN: not known. */
fit_details sdm_fit_map_details(const fit_maps *maps, double thinnest);
