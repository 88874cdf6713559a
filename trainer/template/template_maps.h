/* The template of a part: exact distances and gradients on the lattices `near` and `far`. */
#pragma once

#include "template_design.h"

/* Sets near, far and their nodes of all parts. The lattice `near` has the spacing of the grid (its
   smallest) and reaches `margin` voxels beyond the surface; `far` reaches as far as the grid over
   random parameters. The frames must be set. */
sdm_status trainer_template_maps(template_design *d, double margin, sdm_error *err);
