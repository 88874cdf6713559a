/* From words on the command line to objects: shapes with their options, parameters, tables of
 * parameters, grids. */
#ifndef CLI_SETUP_H
#define CLI_SETUP_H

#include "args/options.h"
#include "sdm/model.h"
#include "sdm/registry.h"
#include "sdm/runtime.h"

/* The built-in shapes, those of SDMGEN_PLUGIN_PATH and those of --plugin. Freed with
 * sdm_registry_free(). */
sdm_status cli_open_registry(const cli_args *args, sdm_registry **out, sdm_error *err);

/* NULL: there is none, SDM_E_ARG in *err with "did you mean". */
const sdm_shape *cli_find_shape(const sdm_registry *r, const char *name, sdm_error *err);

/* Shape `name` with the -O options of the command line (files relative to the current folder).
 * SDM_E_ARG with "did you mean". */
sdm_status cli_open_shape(const sdm_registry *r, const char *name, const cli_list *options,
                          sdm_instance **out, sdm_error *err);

/* A model where files of other types could be given, too: what is known is told of a file that is
 * none. */
sdm_status cli_open_model(const char *path, sdm_model **out, sdm_error *err);

/* Parameters of a model as a shape's: *out points into `info` and is freed with sdm_free(). */
sdm_status cli_model_params(const sdm_model_info *info, sdm_param **out, sdm_error *err);

/* Of --policy. */
sdm_range_policy cli_policy(const cli_args *args);

/* values[n] = the defaults, then the -p name=value words. SDM_E_ARG: an unknown or repeated name,
   not a number. NaN and infinities pass: the range check that follows names them. */
sdm_status cli_read_params(const sdm_param *params, size_t n, const cli_list *given, double *values,
                           sdm_error *err);

/* A table of parameters: a header line of names, then a line of numbers for each row; the others
 *take base[n]. values[n_rows][n] is freed with sdm_free(). SDM_E_IO, SDM_E_FORMAT with file and
 *line. */
sdm_status cli_read_rows(const char *path, const sdm_param *params, size_t n, const double *base,
                         double **values, size_t *n_rows, sdm_error *err);

/* SDM_E_RANGE naming the first value that is not finite or not in its range. */
sdm_status cli_check_range(const sdm_param *params, size_t n, const double *values, sdm_error *err);

/* "a=4.4 alpha=0.5". */
void cli_add_params(const sdm_param *params, size_t n, const double *values, sdm_text *out);

/* The grid of --size, --spacing and --origin; what is missing is fitted to the box min..max.
 * SDM_E_ARG. */
sdm_status cli_fit_grid(const cli_args *args, const double min[3], const double max[3],
                        sdm_grid *out, sdm_error *err);

/* Reads a mesh file; a type that is not known is SDM_E_FORMAT here. */
sdm_status cli_read_mesh(const char *path, sdm_mesh *out, sdm_error *err);

/* Adds the grid as an object under `key`. */
void cli_json_grid(sdm_json *json, const char *key, const sdm_grid *g);

#endif
