/* The parts of a shape: components that move alike, with the type and the parent of each frame. */
#pragma once

#include "motion.h"
#include "template_design.h"

/* Motions that leave at most this part of a voxel count as rigid or affine. */
#define TRAINER_RIGID 0.02

/* Sets n_parts, vertices, first, and of each part: parent, frame, and n_modes = 1 if it needs a
   warp (the number of modes is set later). tolerance: root mean square distance (mm) below which a
   motion counts as rigid or affine. Errors as trainer_template_design(). */
sdm_status trainer_template_parts(template_design *d, double tolerance, sdm_error *err);

/* *out = whether the template of a family needs a warp or a correction, as far as its first meshes
   tell: a component moves neither rigidly nor affinely, or the only one not rigidly. The meshes of
   *from are not set. tolerance, errors: as above. */
sdm_status trainer_template_bends(const family *from, double tolerance, bool *out, sdm_error *err);

/* *out = whether the template can be several parts although one bends, so that it needs no
   correction: there are several components, or the only one has pieces. The meshes of *from are not
   set. tolerance, errors: as above. */
sdm_status trainer_template_divides(const family *from, double tolerance, bool *out,
                                    sdm_error *err);

/* *out = the motion of part c from the base mesh to `vert` of another mesh, by the type of its
   frame. Returns the root mean square distance that remains, mm. */
double trainer_template_motion(const template_design *d, size_t c, const double *vert, motion *out);
