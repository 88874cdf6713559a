/* The `template` network (sdm/internal/template.h) as a kind of network of the trainer. */
#pragma once

#include "state/kind.h"

/* *bends = whether the template needs a warp or a correction, as far as the first meshes tell.
   t->data has the ranges of the parameters. SDM_E_UNSUPPORTED: the shape allows no template. */
sdm_status trainer_template_look(const trainer *t, bool *bends, sdm_error *err);

/* *divides = whether the template of a shape that bends can consist of several parts; such a
   template needs no correction. Two dozen meshes are made to decide it. t and errors as for
   trainer_template_look(). */
sdm_status trainer_template_look_parts(const trainer *t, bool *divides, sdm_error *err);

extern const train_kind trainer_kind_template;
