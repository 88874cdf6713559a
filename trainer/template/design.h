/* The design of a template network from the meshes of a shape alone: parts, frames, warps,
   templates (sdm/internal/template.h). No exact map is needed. */
#pragma once

#include "template_design.h"

/* Fills *d. family.shape, n_params, min, max, distribution, seed and n_threads, and grid must be
   set. With d->split, the design ends with d->model = NULL if it has one part only.
   SDM_E_UNSUPPORTED: the vertices of the shape's meshes do not correspond. Call
   trainer_template_design_dispose() also after an error. */
sdm_status trainer_template_design(template_design *d, sdm_error *err);
void trainer_template_design_dispose(template_design *d);

/* The content of a model file; info and correction are left to the caller. */
sdm_template_spec trainer_template_spec(const template_design *d);
