/* Prints the command that follows the advice of a finished training. */
#pragma once

#include "args/options.h"
#include "sdm/internal/train.h"
#include "study/evaluate.h"

/* Prints the line `next` (of a good model `better`, which has a grid for the uses that it leaves
   out where its error is small), or nothing where the verdict advises nothing. Where a template
   errs near the surface, the command trains `pod`, with so many minutes (0: the configuration gives
   another budget), twice as many if `auto` has trained it in a part of them; if it was much worse
   then, the line says that none helps. kind: that of the model, if network.kind was auto; the
   command states it, so that it trains the same kind again, and a second line tells what a map
   costs with it, ms_map; else NULL. */
void cli_print_next(const cli_args *args, const sdm_train_report *r, const char *kind,
                    double ms_map, double minutes);

/* Prints the line `far away` where the template errs far from the surface alone, and `slow` where
   it takes over a third of the time of an exact map: what `auto` has measured of `pod`, and where
   its model is, or the command that trains it with so many minutes (0: the configuration gives
   another budget). */
void cli_print_pod(const cli_args *args, const sdm_train_report *r, const cli_timing *times,
                   double minutes);
