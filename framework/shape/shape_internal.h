/* What the files of this folder share. */
#ifndef SHAPE_INTERNAL_H
#define SHAPE_INTERNAL_H

#include "sdm/mesh.h"
#include "sdm/registry.h"

#define SHAPE_NAME_MAX 63
#define SHAPE_PARAMS_MAX 64
#define SHAPE_OPTIONS_MAX 64

/* shape_check.c: copies min(size, sizeof) of a plug-in's table to a zeroed one and checks what it
   says. The message starts with the origin. */
sdm_status sdm_shape_copy_checked(const sdm_shape *table, const char *origin, sdm_shape *out,
                                  sdm_error *err);

/* Names, ranges and defaults of parameters; `who` starts the messages. */
sdm_status sdm_shape_check_params(const char *who, const sdm_param *params, uint32_t n,
                                  sdm_error *err);

/* registry.c: forgets the shapes from `count` on; keeps an opened object to be closed with the
 * registry. */
void sdm_registry_shrink(sdm_registry *r, size_t count);
sdm_status sdm_registry_keep(sdm_registry *r, void *object, sdm_error *err);

/* loader.c, or loader_none.c where there are no shared objects. */
void sdm_object_close(void *object);

/* options.c: values[n_options], their text in one block *text (sdm_free()). */
sdm_status sdm_shape_parse_options(const sdm_shape *shape, const sdm_named_text *given,
                                   size_t n_given, const char *base_dir, sdm_option_value *values,
                                   char **text, sdm_error *err);

/* host.c: one call of a callback. `mesh` (may be NULL) is where reserve() makes room; without it,
   and with `files`, blocks of the call's own are used. sdm_host_call_end() frees these. */
typedef struct host_call {
    sdm_host host;
    sdm_mesh *mesh;
    bool files;
    struct host_block *blocks;
    sdm_error err; /* status SDM_OK until something fails */
} host_call;

void sdm_host_call_begin(host_call *c, sdm_mesh *mesh, bool files);
void sdm_host_call_end(host_call *c);

/* The status and text of a callback that returned non-zero: memory stays SDM_E_NOMEM, everything
 * else becomes `otherwise`. */
sdm_status sdm_host_call_failed(const host_call *c, const char *callback, int returned,
                                sdm_status otherwise, sdm_error *err);

struct sdm_instance {
    const sdm_shape *shape;
    void *self;
    const sdm_param *params;
    size_t n_params;
    sdm_option_value *options;
    char *text;
};

/* instance.c: puts "shape 'NAME' at a=4.4 alpha=0.5 ...: " before the text of *err. */
sdm_status sdm_instance_fail_at(const sdm_instance *s, const double *p, sdm_status status,
                                sdm_error *err);

#endif
