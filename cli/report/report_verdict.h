/* Prints the verdict on a training. */
#pragma once

#include "sdm/internal/verdict.h"

/* Prints the measurements of a training on stdout: the error by distance, of volumes and
 * derivatives, its parts, the steps and the grid. */
void cli_print_measurements(const sdm_verdict *v);

/* text[16] = an error in per cent: a whole number from 10 on. Returns text. */
const char *cli_percent(double share, char text[16]);

/* Prints on stdout how good the model is, for which uses it is not, and what limits it. */
void cli_print_verdict(const sdm_verdict *v);

/* Prints `lines` (sdm_model_quality.unfit) on stdout, each after `width` columns and a space, the
 * first one with `label`. */
void cli_print_unfit(const char *lines, const char *label, int width);
