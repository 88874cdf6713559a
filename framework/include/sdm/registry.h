/* The host's side of plug-ins: registry, loader, instances. */
#ifndef SDM_REGISTRY_H
#define SDM_REGISTRY_H

#include <stdbool.h>

#include "sdm/mesh.h"
#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A set of known shapes. Filled at start-up by one thread, then read by any. */
typedef struct sdm_registry sdm_registry;

SDM_API sdm_status sdm_registry_create(sdm_registry **out, sdm_error *err);
SDM_API void sdm_registry_free(sdm_registry *r); /* closes loaded plug-ins: free instances first */

/* Checks abi, size, names, ranges and required callbacks and stores a copy of the table (min(size,
   sizeof) of it). `origin` is said in messages ("built in" or a file). SDM_E_PLUGIN names what is
   wrong; another shape of the same name is refused. */
SDM_API sdm_status sdm_registry_add(sdm_registry *r, const sdm_shape *shape, const char *origin,
                                    sdm_error *err);

/* Loads a shared object and adds all its shapes; `file` comes from the command line or the
   environment, never from a config. SDM_E_PLUGIN; SDM_E_UNSUPPORTED in a build without shared
   objects (SDM_PLUGINS=OFF). */
SDM_API sdm_status sdm_registry_load(sdm_registry *r, const char *file, sdm_error *err);

/* Loads every *.so in the folders of a colon-separated path (value of SDMGEN_PLUGIN_PATH); NULL
 * does nothing. Errors as above. */
SDM_API sdm_status sdm_registry_load_path(sdm_registry *r, const char *path, sdm_error *err);

SDM_API size_t sdm_registry_count(const sdm_registry *r);
SDM_API const sdm_shape *sdm_registry_at(const sdm_registry *r,
                                         size_t index); /* in order of addition */
SDM_API const char *sdm_registry_origin(const sdm_registry *r, size_t index);
/* NULL when unknown; then *nearest (may be NULL) is a similar name or NULL. */
SDM_API const sdm_shape *sdm_registry_find(const sdm_registry *r, const char *name,
                                           const char **nearest);

/* A shape with its options fixed. Immutable after creation: any number of threads may call it. */
typedef struct sdm_instance sdm_instance;

typedef struct sdm_named_text {
    const char *name, *value;
} sdm_named_text;

/* Fixes the options given as text by name; the others take their defaults. base_dir (may be NULL):
   folder against which relative FILE options are resolved. SDM_E_CONFIG: an unknown option (with
   "did you mean"), a bad value; SDM_E_PLUGIN: create() failed. */
SDM_API sdm_status sdm_instance_create(const sdm_shape *shape, const sdm_named_text *options,
                                       size_t n_options, const char *base_dir, sdm_instance **out,
                                       sdm_error *err);
SDM_API void sdm_instance_free(sdm_instance *s);

SDM_API const sdm_shape *sdm_instance_shape(const sdm_instance *s);
SDM_API const sdm_param *sdm_instance_params(const sdm_instance *s, size_t *n);
SDM_API const sdm_option_value *
sdm_instance_options(const sdm_instance *s); /* in the order of the shape's table */
SDM_API int sdm_instance_param_index(const sdm_instance *s, const char *name); /* -1 when unknown */

/* p[n_params]: finite and inside [min, max] of each parameter, else SDM_E_RANGE naming it, its
 * value and range. */
SDM_API sdm_status sdm_instance_check(const sdm_instance *s, const double *p, sdm_error *err);

/* The mesh at p, checked: parameters before, indices and coordinates after the call. *out is
   zero-initialised or reused. SDM_E_RANGE, SDM_E_PLUGIN (with shape, parameters and reason),
   SDM_E_NOMEM. [any thread] */
SDM_API sdm_status sdm_instance_mesh(const sdm_instance *s, const double *p, sdm_mesh *out,
                                     sdm_error *err);

/* velocity[n_params][n_vert][3] by the plug-in's callback, or by central differences of the mesh
   (one-sided at a range's end). [any thread] */
SDM_API sdm_status sdm_instance_velocity(const sdm_instance *s, const double *p, size_t n_vert,
                                         double *velocity, sdm_error *err);

/* Closed-form distance; SDM_E_UNSUPPORTED when the shape has none. [any thread] */
SDM_API sdm_status sdm_instance_distance(const sdm_instance *s, const double *p, const double x[3],
                                         double *distance, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
