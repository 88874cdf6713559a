/* Tables for distances at points: the sides of features and the tree for single points. They are
   made when the first hundred points are asked for, not in the preparation, which maps need only.
   Answers without them are the same, but slower. */
#pragma once

#include "features/nearest.h"

typedef struct sdm_point_aids sdm_point_aids;

/* *out = new empty tables, to be freed with sdm_point_aids_free(). SDM_E_NOMEM. */
sdm_status sdm_point_aids_create(sdm_point_aids **out, sdm_error *err);
void sdm_point_aids_free(sdm_point_aids *a);

/* The surface to be used for n further points: *surface with its members features.side (if
   `bounds`: the surface bounds a solid) and features.wide, once they are made; else *surface
   itself: if few points have been asked for, another thread is making them, or they do not fit into
   memory or `limit` bytes (0: no limit). [any thread] */
const sdm_nearest *sdm_point_aids_use(sdm_point_aids *a, const sdm_nearest *surface, bool bounds,
                                      size_t limit, size_t n);
