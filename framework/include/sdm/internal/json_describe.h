/* Describes grids and parameters as JSON, with the members that every JSON text of the program uses
   for them. */
#pragma once

#include "sdm/grid.h"
#include "sdm/internal/text.h"
#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Adds v[n] as an array. key: NULL inside an array. */
void sdm_json_reals(sdm_json *j, const char *key, const double *v, size_t n);

/* Adds the grid as an object: size, spacing and origin (mm), and with `with_direction` the
   direction matrix. key: NULL inside an array and at the beginning of a text. */
void sdm_json_grid(sdm_json *j, const char *key, const sdm_grid *g, bool with_direction);

/* Adds the members name, unit, min, max and default of a parameter to the open object. */
void sdm_json_parameter(sdm_json *j, const char *name, const char *unit, double min, double max,
                        double def);

/* Adds the member "distribution" to the open object: "uniform", or "normal" with "mean" and
   "deviation". */
void sdm_json_distribution(sdm_json *j, const sdm_distribution *d);

#ifdef __cplusplus
}
#endif
