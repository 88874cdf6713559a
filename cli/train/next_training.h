/* Prints the command that follows the advice of a finished training. */
#pragma once

#include "args/options.h"
#include "sdm/internal/train.h"

/* Prints the command for a better model: the line `next`, or `better` of a good model. Prints
   nothing where the verdict advises nothing.
   - A good model with a small error gets a grid for the first use that its lines `not for` leave
     out.
   - A template that errs near the surface gets a training of `pod` with `minutes` (0: the
     configuration gives another budget), with twice as many if `auto` has trained `pod` in a part
     of them; if `pod` was much worse then, the line says that no training helps.
   kind: the kind of the model where network.kind was auto, else NULL. The command names it, so that
   the same kind is trained again, and a second line tells the time of a map, ms_map. If auto had
   no time for a trial of the other kind (trial_minutes), the command names no kind, and its
   train.minutes hold the trials of both. */
void cli_print_next(const cli_args *args, const sdm_train_report *r, const char *kind,
                    double ms_map, double minutes);

/* thin_spacing: that which a warning at the beginning asks for, because the grid is too coarse for
   the thinnest part of a shape; NaN: there is none. Puts it in place of what the verdict advises,
   with more minutes in proportion to the voxels, unless its sentence tells of this part or of parts
   that are inside out. */
void cli_show_part_first(sdm_train_report *r, double thin_spacing, double minutes);
