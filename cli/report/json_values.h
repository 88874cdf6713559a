/* JSON members that several commands print alike: vectors, parameters, grids; and JSON files. */
#pragma once

#include "sdm/grid.h"
#include "sdm/internal/text.h"
#include "sdm/shape.h"

/* Adds v[n] as an array. key: NULL inside an array. */
void cli_json_reals(sdm_json *json, const char *key, const double *v, size_t n);

/* Adds an object with one member for each parameter: its name and values[i]. */
void cli_json_params(sdm_json *json, const char *key, const sdm_param *params, size_t n,
                     const double *values);

/* Adds the member "distribution": "uniform" or "normal", the latter with "mean" and "deviation". */
void cli_json_distribution(sdm_json *json, const sdm_distribution *d);

/* Adds the grid as an object: size, spacing and origin (mm), and with `with_direction` the
 * direction matrix. */
void cli_json_grid(sdm_json *json, const char *key, const sdm_grid *g, bool with_direction);

/* Writes the finished text and a line feed to the file `path`. SDM_E_NOMEM when the text is
 * incomplete, SDM_E_IO. */
sdm_status cli_json_write(const sdm_json *json, const char *path, sdm_error *err);
