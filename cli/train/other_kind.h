/* Prints what pod may do better than the template that was trained. */
#pragma once

#include "args/options.h"
#include "sdm/internal/train.h"
#include "study/evaluate.h"

/* Does the template err far from the surface alone, so that another kind is a choice? */
bool cli_errs_far_alone(const sdm_verdict *v);

/* Prints the line `far away` where the template errs far from the surface alone, and `slow` where
   it takes over a third of the time of an exact map: what `auto` has measured of `pod`, and where
   its model is, or the command that trains it with so many minutes (0: the configuration gives
   another budget). */
void cli_print_pod(const cli_args *args, const sdm_train_report *r, const cli_timing *times,
                   double minutes);
