/* The warp of a part: modes of the displacements of its vertices that its frame leaves over. */
#pragma once

#include "motion.h"
#include "template_design.h"

/* Sets n_modes, warp and modes of part c from the displacements of its vertices at the random
   parameters 0 .. S - 1 of the family, where frames[S] are the part's frames, and *amplitude = new
   array [S][M]. The modes are the leading principal components of the displacements (snapshots;
   Sirovich 1987), as many as leave at most `tolerance` (mm, root mean square); an amplitude of 1
   moves a vertex by 1 mm (root mean square). Free *amplitude also after an error. */
sdm_status trainer_template_warp(template_design *d, size_t c, size_t n_samples,
                                 const motion *frames, double tolerance, double **amplitude,
                                 sdm_error *err);
