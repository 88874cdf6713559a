/* Shapes by name: a registry holds the shapes, an instance is a shape with fixed options, whose
 * mesh and measures can be computed at parameters.
 *
 * Order of calls: sdm_registry_create(); sdm_builtin_shapes_add() or sdm_registry_load();
 * sdm_registry_find(); sdm_instance_create(); sdm_instance_mesh(). */
#ifndef SDM_REGISTRY_H
#define SDM_REGISTRY_H

#include <stdbool.h>

#include "sdm/mesh.h"
#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A set of shapes. Fill it from one thread; after that any thread may read it. */
typedef struct sdm_registry sdm_registry;

/* *out = an empty registry; free it with sdm_registry_free(). SDM_E_NOMEM. */
SDM_API sdm_status sdm_registry_create(sdm_registry **out, sdm_error *err);
/* Frees the registry and unloads the plug-ins that were loaded: free all instances first. NULL is
 * allowed. */
SDM_API void sdm_registry_free(sdm_registry *r);

/* Checks ABI version, size, names, ranges and required callbacks of the table *shape and stores a
 * copy of it (min(shape->size, sizeof(sdm_shape)) bytes). `origin` appears in messages ("built in"
 * or a file name). SDM_E_PLUGIN names the mistake; a second shape of the same name is a mistake,
 * too. */
SDM_API sdm_status sdm_registry_add(sdm_registry *r, const sdm_shape *shape, const char *origin,
                                    sdm_error *err);

/* Loads a shared object and adds all its shapes. `file` must come from the command line or the
 * environment, never from a configuration. A file that is loaded already, under this name, another
 * one or as a copy of the same bytes, adds nothing. SDM_E_IO: there is no such file;
 * SDM_E_PLUGIN: it is no plug-in, or one whose shapes sdm_registry_add() refuses;
 * SDM_E_UNSUPPORTED in a build without plug-ins (SDM_PLUGINS=OFF). */
SDM_API sdm_status sdm_registry_load(sdm_registry *r, const char *file, sdm_error *err);

/* Loads every *.so in the folders of a colon-separated path (the value of SDMGEN_PLUGIN_PATH); NULL
 * does nothing. A file that cannot be loaded (SDM_E_IO or SDM_E_PLUGIN of sdm_registry_load()) is
 * skipped, and so is a folder that cannot be read. SDM_E_UNSUPPORTED as above. */
SDM_API sdm_status sdm_registry_load_path(sdm_registry *r, const char *path, sdm_error *err);

/* Message number `index` about the files and folders that sdm_registry_load_path() has skipped;
 * NULL: there are fewer. Valid as long as the registry. */
SDM_API const char *sdm_registry_skipped(const sdm_registry *r, size_t index);

SDM_API size_t sdm_registry_count(const sdm_registry *r);
/* Shape and origin of entry `index`, in order of addition. */
SDM_API const sdm_shape *sdm_registry_at(const sdm_registry *r, size_t index);
SDM_API const char *sdm_registry_origin(const sdm_registry *r, size_t index);
/* The shape of this name. If there is none, the result is NULL, which callers must check, and
 * *nearest (`nearest` may be NULL) is a similar name or NULL; sdm_registry_at() lists the names. */
SDM_API const sdm_shape *sdm_registry_find(const sdm_registry *r, const char *name,
                                           const char **nearest);

/* A shape with fixed option values. Immutable after creation, so any number of threads may use
 * it. */
typedef struct sdm_instance sdm_instance;

typedef struct sdm_named_text {
    const char *name, *value;
} sdm_named_text;

/* Checks one option without the others; files are not opened. SDM_E_CONFIG: an unknown option (with
 * "did you mean" or the names) or a bad value. [any thread] */
SDM_API sdm_status sdm_shape_check_option(const sdm_shape *shape, const char *name,
                                          const char *value, sdm_error *err);

/* Creates an instance with the given options; all others have their defaults. Free it with
 * sdm_instance_free(), before the registry. base_dir (may be NULL): folder for relative paths in
 * FILE options. SDM_E_CONFIG: unknown option (with "did you mean") or bad value; SDM_E_PLUGIN: the
 * plug-in's create() failed, or its describe() or distributions() gave values that are not allowed.
 */
SDM_API sdm_status sdm_instance_create(const sdm_shape *shape, const sdm_named_text *options,
                                       size_t n_options, const char *base_dir, sdm_instance **out,
                                       sdm_error *err);
SDM_API void sdm_instance_free(sdm_instance *s);

SDM_API const sdm_shape *sdm_instance_shape(const sdm_instance *s);
/* The *n parameters (n may be NULL), in the order of parameter vectors. Valid as long as the
 * instance. */
SDM_API const sdm_param *sdm_instance_params(const sdm_instance *s, size_t *n);
/* The distributions of the parameters, [n_params] as of sdm_instance_params(); uniform unless the
 * shape states others. Owned by the instance. */
SDM_API const sdm_distribution *sdm_instance_distributions(const sdm_instance *s);
/* Option values in the order of the shape's table. */
SDM_API const sdm_option_value *sdm_instance_options(const sdm_instance *s);
/* Index of a parameter; -1 if there is none of this name. */
SDM_API int sdm_instance_param_index(const sdm_instance *s, const char *name);

/* Checks that every p[n_params] is finite and inside [min, max] of its parameter. SDM_E_RANGE names
 * the parameter, its value and its range. */
SDM_API sdm_status sdm_instance_check(const sdm_instance *s, const double *p, sdm_error *err);

/* Computes the mesh at parameters p[n_params]. The parameters are checked before, indices and
 * coordinates of the mesh after the call of the plug-in. *out is zero-initialised or the mesh of an
 * earlier call, whose memory is reused. SDM_E_RANGE, SDM_E_PLUGIN (names shape, parameters and
 * reason), SDM_E_NOMEM. [any thread] */
SDM_API sdm_status sdm_instance_mesh(const sdm_instance *s, const double *p, sdm_mesh *out,
                                     sdm_error *err);

/* velocity[n_params][n_vert][3] = d(vertex)/d(parameter), mm per unit of the parameter: from the
 * plug-in's callback, otherwise by central differences of the mesh (one-sided at the end of a
 * range). [any thread] */
SDM_API sdm_status sdm_instance_velocity(const sdm_instance *s, const double *p, size_t n_vert,
                                         double *velocity, sdm_error *err);

/* *distance = closed-form signed distance (mm) at x[3]; SDM_E_UNSUPPORTED if the shape has none.
 * [any thread] */
SDM_API sdm_status sdm_instance_distance(const sdm_instance *s, const double *p, const double x[3],
                                         double *distance, sdm_error *err);

/* A measure of a shape and its value. */
typedef struct sdm_measured {
    /* texts that live as long as the shape and the library */
    const char *name, *unit, *help;
    double depth; /* mm, of a measure at a depth; else NaN */
    /* NaN: beyond the end of the shape; the volume of a mesh that is not closed; or not measured */
    double value;
    /* standard deviation by sdm_fit_measure(): 0 where the measure depends on nothing that was
     * fitted; NaN: unknown, or not of a fit */
    double sd;
    /* sdm_fit_measure(): true: the data say no more about the measure than the priors and ranges of
     * the parameters, as sdm_fit_result.by_prior says it of a parameter */
    bool not_determined;
} sdm_measured;

/* largest number of measures of a shape, each depth counted */
#define SDM_MEASURES_MAX 128

/* The measures of a shape: its own, those of a depth for each depth; then volume (mm^3), area
 * (mm^2) and extents (mm) along the axes of its frame, all of the union of the mesh's volumes
 * (sdm_exact_surface()). */
typedef struct sdm_measures {
    size_t n;
    sdm_measured at[SDM_MEASURES_MAX];
} sdm_measures;

/* Measures the shape at p[n_params]; p NULL: only names, units and texts. depths[n_depths] (mm, >=
 * 0): where measures of a depth are taken; without depths these are left out. SDM_E_ARG: a depth
 * that is negative or not finite, too many, or any if the shape has no measure of a depth;
 * SDM_E_RANGE; SDM_E_PLUGIN: names shape, measure, parameters and reason; SDM_E_MESH, SDM_E_NOMEM.
 * [any thread] */
SDM_API sdm_status sdm_shape_measure(const sdm_instance *s, const double *p, const double *depths,
                                     size_t n_depths, sdm_measures *out, sdm_error *err);

/* The first measure of the list with this name, such as "volume"; NULL: there is none. It belongs
 * to the list. [any thread] */
SDM_API const sdm_measured *sdm_measures_find(const sdm_measures *m, const char *name);

#ifdef __cplusplus
}
#endif
#endif
