/* Why the surfaces of a network's maps enclose wrong volumes. */
#pragma once

#include <stdbool.h>

/* Voxels cut edges and thin walls off surfaces, and change the volumes of the maps themselves
   little. Do they explain that surfaces are off by `surface` of their volume, where maps are off by
   `map` of theirs? Else the network errs. NaN, not known: voxels. [any thread] */
static inline bool sdm_voxels_explain_volume(double surface, double map)
{
    return !(surface < 2 * map);
}
