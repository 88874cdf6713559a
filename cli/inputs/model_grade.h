/* What the training said about a model, for the commands that use it. */
#pragma once

#include "sdm/model.h"

/* Warns in one line if the training graded the model poor, or if its grid cuts more than 5 % of the
 * shapes of its family. Says nothing about models without a verdict. */
void cli_warn_quality(const char *path, const sdm_model_info *m);

/* Warns in one line if the thinnest part of the shapes of the training is too thin for the voxels
 * of the model or of the grid g, whichever are larger. Returns whether it did. */
bool cli_warn_thin_model(const char *path, const sdm_model_info *m, const sdm_grid *g);

/* Warns if the derivatives of the model's maps are off by over a fifth for a parameter. */
void cli_warn_derivatives(const char *path, const sdm_model *m);

/* Prints the verdict as lines of `info`. */
void cli_print_quality(const sdm_model_info *m);
