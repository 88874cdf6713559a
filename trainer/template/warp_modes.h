/* The warp of a part: modes of the displacements of its vertices that its frame leaves over. */
#pragma once

#include "template_design.h"

/* Displacements of the vertices of part c at S parameter vectors x[S][P] (scaled to -1 .. 1), in
   the frame motion[S] (motion.h: struct motion, as doubles m[9], b[3]). Sets n_modes, warp and
   modes of the part and *amplitude = new array [S][M]. The modes are the leading principal
   components of the displacements (snapshots; Sirovich 1987), as many as leave at most `tolerance`
   (mm, root mean square); *weight = new array [M], the root mean square displacement (mm) of a
   vertex by an amplitude of 1. */
struct motion;
sdm_status trainer_template_warp(template_design *d, size_t c, size_t n_samples,
                                 const struct motion *frames, double tolerance, double **amplitude,
                                 double **weight, sdm_error *err);
