/* Writes the command that repeats a training with changes. */
#pragma once

#include "args/options.h"
#include "sdm/internal/train.h"

/* Prints `begin` and the command: the files, keys and options of the command line, with the changes
   of a verdict (key, to, minutes, and grid=auto where the grid changes) in place of theirs, and
   --compare with the model of this run.
   kind: the value of network.kind, NULL: as it was. end: the name of the new folder is longer than
   the present one by this text. Returns whether the command was printed; it is not if memory is
   short. */
bool cli_print_training(const char *begin, const cli_args *args, const sdm_train_report *r,
                        const sdm_verdict *changes, const char *kind, const char *end);
