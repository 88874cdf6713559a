/* Places spread over the surface of the fitted shape. */
#pragma once

#include "map_fields.h"

typedef struct fit_places {
    size_t n;
    /* [n] in the world, mm */
    double (*world)[3];
    /* [n][n_params] derivatives of the signed distance by the parameters */
    double *by;
} fit_places;

/* *out = at most `most` places: on the triangles of the shape, surface inside a union left out,
   where the fit measures distances from them; else on the map, one for each voxel that the surface
   passes, or for every second, third ... one. On error *out is empty. SDM_E_NOMEM. */
sdm_status sdm_fit_places_create(const fit_maps *maps, const fit_state *state, size_t most,
                                 fit_places *out, sdm_error *err);
void sdm_fit_places_dispose(fit_places *places);
