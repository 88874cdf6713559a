/* The template of a part: exact distances and gradients on the lattices `near` and `far`. */
#pragma once

#include "template_design.h"

/* Sets near, far and their nodes of all parts. The lattice `near` has the spacing of the grid (its
   smallest) and reaches six voxels beyond the surface, three if the part has a warp: parts without
   one are interpolated in all blocks that `near` does not wholly contain. `far` has three times
   the spacing and reaches as far as the grid and one block more over random parameters. The frames
   must be set. */
sdm_status trainer_template_maps(template_design *d, sdm_error *err);
