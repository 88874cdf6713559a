/* Rotation vectors of frames that turn by more than half a turn. */
#pragma once

#include "template_design.h"

/* y[S][N] = the numbers of all frames at the random parameters 0 .. S - 1 of the family, with
   rotation vectors of at most pi. Where the rotations of a part come near to pi, they become those
   that grow without a jump on the straight way from the default parameters, so that they are smooth
   functions of the parameters, also beyond pi. Errors as trainer_template_design(). */
sdm_status trainer_template_unwrap(const template_design *d, size_t n_samples, double *y,
                                   sdm_error *err);
