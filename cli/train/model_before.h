/* Compares the model that a training has made with one of before: the one that --force replaces, or
 * the one of --compare. Both are measured at the same exact surfaces, whatever their grids are. */
#pragma once

#include "sdm/internal/text.h"
#include "sdm/model.h"
#include "sdm/registry.h"

typedef struct cli_before {
    /* Why the models cannot be compared; "": they can, or there is none of before. */
    char why_not[160];
    /* Root mean square of the distances that the model of before, and the new one, give at points
       of exact surfaces, where the distance is 0, mm; NaN: not measured. */
    double surface_was_mm, surface_mm;
    /* The root mean square error of all voxels that each states for its held-out shapes, mm; NaN:
       the grids differ. */
    double rmse_was_mm, rmse_mm;
} cli_before;

/* *out = the model of before, to be freed with sdm_model_free(): compare, if it is not NULL, else
   the model of the run folder; NULL: the folder holds none that can be read. shape: the one to be
   trained. Errors of reading `compare`; SDM_E_ARG: it is a model of another shape. */
sdm_status cli_before_open(const char *compare, const char *folder, const sdm_instance *shape,
                           sdm_model **out, sdm_error *err);

/* Measures both models at 16 random shapes of their ranges. path: the new one. before NULL: there
   is nothing to compare. Errors of the shape, of reading and of sdm_generate_points(). */
sdm_status cli_before_measure(const sdm_model *before, const char *path, const sdm_instance *shape,
                              cli_before *out, sdm_error *err);

/* Prints the line `before` of the end of a training, if there is something to compare. */
void cli_before_print(const cli_before *b);

/* The members before_rmse_mm, before_surface_mm and surface_mm, those that are known. */
void cli_before_json(const cli_before *b, sdm_json *j);
