/* The model that a training with --force replaces, for a comparison of the errors. */
#pragma once

#include "sdm/model.h"

/* The model of a run folder, to be freed with sdm_model_free(); NULL: it holds none that can be
 * read. */
sdm_model *cli_model_before(const char *folder);

/* The root mean square error that the model `before` states for its held-out shapes, mm. NaN: it
   cannot be compared with that of the new model in the file `path`, because shape, options, ranges,
   distributions or grid differ, or `before` is NULL. */
double cli_before_rmse(const sdm_model *before, const char *path);

/* Prints the line `before` of the end of a training: both errors, and which is smaller. */
void cli_print_before(double before_mm, double now_mm);
