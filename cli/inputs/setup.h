/* Opens the inputs of the command line: shapes with their options and parameters, models, tables of
 * parameters, grids and mesh files. */
#pragma once

#include "args/options.h"
#include "sdm/internal/shape_repeat.h"
#include "sdm/model.h"
#include "sdm/registry.h"
#include "sdm/runtime.h"

/* *out = a registry of the built-in shapes and of the plug-ins of --plugin and, after them, in
 * SDMGEN_PLUGIN_PATH; free it with sdm_registry_free(). A file in the path that cannot be loaded or
 * has a shape that is there already gives a notice. SDM_E_PLUGIN, SDM_E_NOMEM. */
sdm_status cli_open_registry(const cli_args *args, sdm_registry **out, sdm_error *err);

/* The shape of that name. NULL: there is none; *err holds SDM_E_ARG with "did you mean". */
const sdm_shape *cli_find_shape(const sdm_registry *r, const char *name, sdm_error *err);

/* Creates the shape `name` with the options "name=value" of -O; relative paths start from the
 * current folder. *out is freed with sdm_instance_free(). SDM_E_ARG with "did you mean". */
sdm_status cli_create_shape(const sdm_registry *r, const char *name, const cli_list *options,
                            sdm_instance **out, sdm_error *err);

/* Where meshes of the shape, which the registry holds, can be made in another process; its
 * `plugin` is NULL if the shape is built in. Stays valid as long as the registry. */
sdm_repeat_process cli_other_process(const cli_args *args, const sdm_registry *r,
                                     const sdm_instance *shape);

/* A shape with the registry that holds it and the parameter values of the command line.
 * Zero-initialise; cli_shape_dispose() frees, also after an error. */
typedef struct cli_shape {
    sdm_registry *registry;
    sdm_instance *instance;
    const sdm_param *params; /* [n_params], owned by the instance */
    size_t n_params;
    double *values; /* [n_params] values of -p, else the defaults; not checked for range yet */
} cli_shape;

/* Opens the registry, creates the shape `name` with the options and reads the values of -p. With
 * --isolate, the mesh at these values must have the same bits twice. SDM_E_ARG, SDM_E_PLUGIN. */
sdm_status cli_shape_open(const cli_args *args, const char *name, const cli_list *options,
                          cli_shape *out, sdm_error *err);
void cli_shape_dispose(cli_shape *shape);

/* Opens a model, which must be the one of --expect if that is given. *out is freed with
 * sdm_model_free(). Errors of sdm_model_open(); SDM_E_FORMAT: another model; SDM_E_ARG: --expect is
 * no hash. */
sdm_status cli_open_model(const cli_args *args, const char *path, sdm_model **out, sdm_error *err);

/* The same for commands that also accept other types of files: if the file is no model, the message
 * lists these types. */
sdm_status cli_open_unknown(const cli_args *args, const char *path, sdm_model **out,
                            sdm_error *err);

/* SDM_E_ARG if --expect is given: for commands whose input is no model. */
sdm_status cli_expect_model(const cli_args *args, sdm_error *err);

/* SDM_E_ARG if --plugin or --isolate is given to a command whose input needs no shape: `input`
 * names the input in the message. */
sdm_status cli_refuse_plugins(const cli_args *args, const char *input, sdm_error *err);

/* *out[info->n_params] = the parameters of a model in the form of a shape's. Their texts belong to
 * `info`; the array is freed with sdm_free(). */
sdm_status cli_model_params(const sdm_model_info *info, sdm_param **out, sdm_error *err);

/* The value of --policy. */
sdm_range_policy cli_policy(const cli_args *args);

/* The value of --outside. */
sdm_outside cli_outside(const cli_args *args);

/* values[n] = the defaults, overridden by the "name=value" arguments of -p. SDM_E_ARG: an unknown
 * or repeated name, or not a number. NaN and infinities pass: the range check that follows rejects
 * them with the name of the parameter. */
sdm_status cli_read_params(const sdm_param *params, size_t n, const cli_list *given, double *values,
                           sdm_error *err);

/* Reads a CSV table of parameters: a header line of names, then a line of numbers for each row.
 * Parameters without a column have the values base[n]; one with a column must not be in given, the
 * texts of -p name=value. *values[*n_rows][n] and, unless lines is
 * NULL, *lines[*n_rows], the number of the line of each row, are freed with sdm_free(). SDM_E_ARG:
 * too many parameters, or one given twice; SDM_E_IO; SDM_E_FORMAT with file and line. */
sdm_status cli_read_rows(const char *path, const sdm_param *params, size_t n, const double *base,
                         const cli_list *given, double **values, int **lines, size_t *n_rows,
                         sdm_error *err);

/* SDM_E_RANGE with the name of the first parameter that is not finite or outside of its range. */
sdm_status cli_check_range(const sdm_param *params, size_t n, const double *values, sdm_error *err);

/* As cli_check_range() for the parameters of a model, with the values of --policy that accept
 * others: --policy exact only where the shape is known and its own range holds the values. */
sdm_status cli_check_trained(const cli_args *args, const sdm_model *m, const sdm_param *params,
                             const double *values, sdm_error *err);

/* Moves values[n] into the ranges of the parameters; a notice that begins with `begin` names each
 * one that was moved. Returns whether one was. */
bool cli_clamp(const char *begin, const sdm_param *params, size_t n, double *values);

/* Appends the values as "a=4.4 alpha=0.5". */
void cli_add_params(const sdm_param *params, size_t n, const double *values, sdm_text *out);

/* *out = the grid of the file that --like names, a model or an image. SDM_E_ARG: --size or another
 * option that states a grid is given, too, or the file has another type; errors of sdm_model_open()
 * and sdm_volume_read(). */
sdm_status cli_like_grid(const cli_args *args, sdm_grid *out, sdm_error *err);

/* *out = the grid of --like or the axis-aligned grid of --size, --spacing and --origin. Missing
 * options are chosen so that the grid covers the box min .. max (mm) with a margin of 0.1 times its
 * longest edge; without --size and --spacing it has 64 voxels along that edge, margins included.
 * SDM_E_ARG; errors of cli_like_grid(). */
sdm_status cli_grid_for_box(const cli_args *args, const double min[3], const double max[3],
                            sdm_grid *out, sdm_error *err);

/* *out = the grid of --like, or of --size, --spacing, --origin and --direction, for maps of a
 * model. Without
 * --size it fills the box of the voxel centres of the model's grid; without --spacing it is that of
 * the model, or with --size the smallest uniform one with which the grid covers the box; without
 * --origin the grid has the centre of the box; without --direction the axes are the model's. *own:
 * no option is given, the grid is that of the model. SDM_E_ARG; errors of cli_like_grid(). */
sdm_status cli_model_grid(const cli_args *args, const sdm_grid *model, sdm_grid *out, bool *own,
                          sdm_error *err);

/* Returns s, the status of a map on the grid g of cli_model_grid(). Where --size alone made this
 * grid leave the box of the model, begins the message with size and spacing that do not. */
sdm_status cli_explain_size(const cli_args *args, const sdm_grid *model, const sdm_grid *g,
                            sdm_status s, sdm_error *err);

/* As sdm_mesh_read(), but returns SDM_E_FORMAT instead of SDM_E_UNSUPPORTED for an unknown type of
 * file. */
sdm_status cli_read_mesh(const char *path, sdm_mesh *out, sdm_error *err);
